# shellcheck shell=sh
# Runs on the robot, sent there by tools/flash: flash_remote.sh install|rollback.
# Keeps in ~/.local/share/equipoise: new.deb (just sent), current.deb (installed), previous.deb (the one before).
set -u
store=$HOME/.local/share/equipoise
cd "$store" || exit 1

say() { printf 'robot: %s\n' "$*" >&2; }
as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo -n "$@"; fi; }
service_runs() { systemctl is-active --quiet equipoise.service; }

# install_package FILE: installed, and the program starts; after an installation that was interrupted, too.
install_package() {
  as_root env DEBIAN_FRONTEND=noninteractive dpkg --force-confold --configure -a >&2
  as_root env DEBIAN_FRONTEND=noninteractive apt-get -q install -y --allow-downgrades --reinstall \
    -o Dpkg::Options::=--force-confold "$store/$1" >&2 && equipoise --version >&2
}

# What the boot loader applies must fit the running kernel's pin controller.
choose_overlays() {
  [ -x /usr/lib/equipoise/choose-overlays ] || return 0
  cells=$(as_root /usr/lib/equipoise/choose-overlays) || return 1
  [ -z "$cells" ] || say "device-tree overlays for #pinctrl-cells = <$cells>"
}

# A robot that balances is not touched: the package would stop it.
if service_runs && [ "${FORCE:-no}" != yes ]; then
  say "equipoise.service is running; stop it first (sudo systemctl stop equipoise) or use --force"
  exit 3
fi
restart=no
if service_runs; then
  restart=yes
  as_root systemctl stop equipoise.service || exit 1
fi

status=0
case $1 in
install)
  if install_package new.deb; then
    [ ! -f current.deb ] || mv current.deb previous.deb
    mv new.deb current.deb
  else
    status=1
    rm -f new.deb
    if [ -f current.deb ] && install_package current.deb; then
      say "the new package does not work; the old one is back"
    else
      say "the new package does not work and there is no old one to go back to"
    fi
  fi
  ;;
rollback)
  if [ ! -f previous.deb ]; then
    say "there is no previous package here"
    status=1
  elif install_package previous.deb; then
    mv current.deb swap.deb && mv previous.deb current.deb && mv swap.deb previous.deb
  else
    status=1
    say "the previous package does not install; going back to the current one"
    install_package current.deb
  fi
  ;;
esac
choose_overlays || status=1
if [ "$restart" = yes ]; then as_root systemctl start equipoise.service || status=1; fi
exit "$status"
