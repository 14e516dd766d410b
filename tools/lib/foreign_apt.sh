# Sourced after setup.sh: Debian packages of another architecture, without touching this machine's dpkg.
# A private apt root under build/ with its own lists, from the mirror this machine already uses.
# shellcheck shell=bash disable=SC2154,SC2016

# machine_mirror: the address this machine fetches Debian from; empty when it has no Debian source.
machine_mirror() {
  apt-get indextargets --format '$(ORIGIN) $(CODENAME) $(REPO_URI)' 'Created-By: Packages' |
    awk '$1 == "Debian" && $2 !~ /-/ { print $3; exit }'
}

# security_mirror: where it fetches Debian's security updates from, else from the mirror's neighbour.
security_mirror() {
  local found
  found=$(apt-get indextargets --format '$(CODENAME) $(REPO_URI)' 'Created-By: Packages' |
    awk '$1 ~ /-security$/ { print $2; exit }')
  printf '%s\n' "${found:-$(machine_mirror | sed 's|/debian/*$|/debian-security|')}"
}

# foreign_apt ARCHITECTURE SUITE APT-GET-ARGUMENTS...: apt-get in the private root of that pair.
foreign_apt() {
  local architecture=$1 suite=$2 apt_root
  shift 2
  apt_root=$root/build/apt/$suite-$architecture
  if ! grep -qsxF "Dir::State \"$apt_root\";" "$apt_root/apt.conf"; then # absent, or copied along with its tree
    local mirror keyring=/usr/share/keyrings/debian-archive-keyring.gpg
    mirror=$(machine_mirror)
    [ -n "$mirror" ] || die "no Debian mirror among this machine's apt sources (apt-get update first?)"
    mkdir -p "$apt_root"/{lists/partial,cache/archives/partial,empty}
    : >"$apt_root/status"
    printf 'deb [arch=%s signed-by=%s] %s %s main\n' "$architecture" "$keyring" "$mirror" "$suite" \
      >"$apt_root/sources.list"
    cat >"$apt_root/apt.conf.new" <<TEXT
Dir::Etc::sourcelist "$apt_root/sources.list";
Dir::Etc::sourceparts "$apt_root/empty";
Dir::Etc::preferencesparts "$apt_root/empty";
Dir::State "$apt_root";
Dir::State::lists "$apt_root/lists";
Dir::State::status "$apt_root/status";
Dir::Cache "$apt_root/cache";
APT::Architecture "$architecture";
APT::Architectures { "$architecture"; };
APT::Sandbox::User "";
APT::Get::AllowUnauthenticated "false";
APT::Install-Recommends "false";
Acquire::Languages "none";
Acquire::Retries "3";
TEXT
    APT_CONFIG=$apt_root/apt.conf.new apt-get -q update >&2 ||
      die "could not read the package lists of $suite for $architecture"
    mv "$apt_root/apt.conf.new" "$apt_root/apt.conf"
  fi
  APT_CONFIG=$apt_root/apt.conf apt-get -q "$@"
}

# fetch_packages ARCHITECTURE SUITE PACKAGE...: downloads them with all they need; prints the files, one per line.
fetch_packages() {
  local architecture=$1 suite=$2 archives
  shift 2
  archives=$root/build/apt/$suite-$architecture/cache/archives
  foreign_apt "$architecture" "$suite" install -y --download-only "$@" >&2 ||
    die "could not download for $architecture: $*"
  # Exactly what these packages resolve to: leftovers of other downloads stay out.
  foreign_apt "$architecture" "$suite" install -y -s "$@" |
    awk '/^Inst / { gsub(/[()]/, "", $3); print $2, $3 }' |
    while read -r package version; do
      package=${package%%:*}
      version=${version//:/%3a}
      compgen -G "$archives/${package}_${version}_*.deb" || die "missing download: $package $version"
    done
}

# unpack_root DIRECTORY FILE...: their contents as a root file system (merged /usr), nothing run.
unpack_root() {
  local target=$1 file
  shift
  mkdir -p "$target/usr/bin" "$target/usr/lib" "$target/usr/sbin"
  ln -sfn usr/bin "$target/bin"
  ln -sfn usr/lib "$target/lib"
  ln -sfn usr/sbin "$target/sbin"
  for file in "$@"; do
    dpkg-deb --fsys-tarfile "$file" | tar -x -C "$target" --keep-directory-symlink --no-same-owner
  done
}
