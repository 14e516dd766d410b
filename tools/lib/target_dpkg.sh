# Sourced by tools/package: a dpkg database of the target's libraries, for dpkg-shlibdeps in a cross build.
# shellcheck shell=bash disable=SC2154

# target_dpkg SUITE ARCHITECTURE SYSROOT DATABASE: from the packages that tools/sysroot unpacked into SYSROOT; their files are listed
# where they are now.
target_dpkg() {
  local suite=$1 target=$2 sysroot=$3 database=$4 deb name architecture entry info
  local archives=("$root/build/apt/$suite-$target"/cache/archives/*.deb)
  [ -e "${archives[0]}" ] || die "the packages of $sysroot are gone; run tools/sysroot again after rm -r $sysroot"
  rm -rf "$database"
  mkdir -p "$database/info" "$database/updates"
  echo 1 >"$database/info/format"
  echo "$target" >"$database/arch"
  info=$(mktemp -d)
  for deb in "${archives[@]}"; do
    name=$(dpkg-deb --field "$deb" Package)
    architecture=$(dpkg-deb --field "$deb" Architecture)
    entry=$name
    [ "$(dpkg-deb --field "$deb" Multi-Arch)" != same ] || entry=$name:$architecture
    rm -rf "$info/control"
    dpkg-deb --control "$deb" "$info/control"
    sed '/^Package:/a Status: install ok installed' "$info/control/control" >>"$database/status"
    echo >>"$database/status"
    for file in shlibs symbols md5sums; do
      [ ! -e "$info/control/$file" ] || cp "$info/control/$file" "$database/info/$entry.$file"
    done
    # The sysroot's lib is a link to usr/lib, as on the target.
    dpkg-deb --fsys-tarfile "$deb" | tar -t | sed "s|^\.||; s|/\$||; s|^/lib/|/usr/lib/|; s|^|$sysroot|" \
      >"$database/info/$entry.list"
  done
  rm -rf "$info"
}
