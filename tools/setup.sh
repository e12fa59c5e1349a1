# shellcheck shell=bash
# Set-up shared by tools/capi, tools/demo, tools/test, tools/get-data, tools/peers and .ci/run; sourced, not run.
#
# It looks first and installs only what is missing, so a second run touches no package manager. Progress goes to
# stderr in short lines; a package manager's own output is shown only when it fails.

say() { printf '%s: %s\n' "${0##*/}" "$*" >&2; }
stop() {
  say "$*"
  exit 1
}
have() { command -v "$1" >/dev/null 2>&1; }

# --- packages ---------------------------------------------------------------------------------------------------------

# Each need: its packages on Debian and Ubuntu, on Fedora, on Arch, and what to call it. Spaces within are underscores.
needs_table() {
  cat <<'TABLE'
linker        gcc_libc6-dev            gcc                       gcc                       linker_(cc)
certificates  ca-certificates          ca-certificates           ca-certificates           CA_certificates
loader        libvulkan1               vulkan-loader             vulkan-icd-loader         Vulkan_loader
driver        mesa-vulkan-drivers      mesa-vulkan-drivers       vulkan-swrast             Vulkan_device_or_driver
validation    vulkan-validationlayers  vulkan-validation-layers  vulkan-validation-layers  Vulkan_validation_layer
spirv         spirv-tools              spirv-tools               spirv-tools               spirv-val
python        python3_python3-venv     python3                   python                    Python_3_with_venv
headers       libvulkan-dev_libc6-dev  vulkan-headers_vulkan-loader-devel  vulkan-headers_vulkan-icd-loader  Vulkan_headers
valgrind      valgrind                 valgrind                  valgrind                  valgrind
pkgconfig     pkg-config               pkgconf                   pkgconf                   pkg-config
cmake         cmake                    cmake                     cmake                     CMake
opengl        libegl1_libgl1           mesa-libEGL_mesa-libGL    mesa_libglvnd             OpenGL_without_a_window_(EGL)
TABLE
}

# Prints one column of the table for some needs, in one line.
column() { # column, separator, needs…
  local column=$1 separator=$2 need
  shift 2
  for need; do
    needs_table | awk -v need="$need" -v column="$column" '$1 == need { gsub("_", " ", $column); print $column }'
  done | paste -s -d "$separator" | sed 's/,/, /g'
}

# Runs a command as root, or fails: directly, or by a sudo that asks for nothing.
as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi
}
may_install() { [ "$(id -u)" = 0 ] || { have sudo && sudo -n true 2>/dev/null; }; }

# Runs a command silently; shows what it printed only if it fails.
quietly() {
  local log status=0
  log=$(mktemp)
  "$@" >"$log" 2>&1 </dev/null || status=$?
  [ "$status" = 0 ] || tail -n 20 "$log" >&2
  rm -f "$log"
  return "$status"
}

apt() {
  as_root env DEBIAN_FRONTEND=noninteractive \
    apt-get -q -y -o Dpkg::Use-Pty=0 -o DPkg::Lock::Timeout=120 --no-install-recommends "$@"
}

apt_refreshed=
apt_refresh() {
  [ -z "$apt_refreshed" ] || return 0
  say "refreshing the package lists"
  # One unreachable third-party source must not end the set-up; the install that follows says what it lacks.
  quietly apt update || say "some package lists could not be refreshed; going on with what is there"
  apt_refreshed=yes
}

# Says in one line what is missing and how to get it; ends the script.
stop_missing() { # needs…
  local what
  what="missing: $(column 5 , "$@")"
  if have apt-get; then
    stop "$what; to get it, as root: apt-get update && apt-get install $(column 2 ' ' "$@")"
  fi
  stop "$what; to get it, Fedora: dnf install $(column 3 ' ' "$@"); Arch: pacman -S $(column 4 ' ' "$@")"
}

install() { # needs…
  if ! have apt-get || ! may_install; then stop_missing "$@"; fi
  apt_refresh
  local wanted
  read -r -a wanted <<<"$(column 2 ' ' "$@")"
  say "installing ${wanted[*]}"
  quietly apt install "${wanted[@]}" || stop_missing "$@"
}

# --- what is there ----------------------------------------------------------------------------------------------------

has_linker() { have cc; }

# Cargo needs certificates to fetch the dependencies; a variable may name some that are not the system's.
has_certificates() {
  [ -n "${CARGO_HTTP_CAINFO:-}${SSL_CERT_FILE:-}${SSL_CERT_DIR:-}" ] ||
    [ -e /etc/ssl/certs/ca-certificates.crt ] || [ -e /etc/pki/tls/certs/ca-bundle.crt ] || [ -e /etc/ssl/cert.pem ]
}

has_library() { # name of a shared library as the linker knows it
  local ldconfig=ldconfig directory
  have ldconfig || ldconfig=/sbin/ldconfig # not on a Debian user's PATH
  "$ldconfig" -p 2>/dev/null | grep -F "$1" >/dev/null && return 0 # no -q: it would break the pipe
  while read -r -d : directory; do
    if [ -n "$directory" ] && [ -e "$directory/$1" ]; then return 0; fi
  done <<<"${LD_LIBRARY_PATH:-}:"
  return 1
}

has_loader() { has_library libvulkan.so.1; }
has_opengl() { has_library libEGL.so.1 && has_library libGL.so.1; }
# Debian has both modules apart from Python, and venv without ensurepip makes an environment that can install nothing.
has_python() { have python3 && python3 -c 'import ensurepip, venv' 2>/dev/null; }

has_validation() {
  local layers directory
  layers="${VK_LAYER_PATH:-}:${VK_ADD_LAYER_PATH:-}:${VULKAN_SDK:-/usr}/share/vulkan/explicit_layer.d"
  layers+=":/usr/share/vulkan/explicit_layer.d:/usr/local/share/vulkan/explicit_layer.d:/etc/vulkan/explicit_layer.d"
  layers+=":${XDG_DATA_HOME:-${HOME:-}/.local/share}/vulkan/explicit_layer.d:"
  while read -r -d : directory; do
    if [ -n "$directory" ] && [ -e "$directory/VkLayer_khronos_validation.json" ]; then return 0; fi
  done <<<"$layers"
  return 1
}

has_spirv() { have spirv-val; }
has_valgrind() { have valgrind; }
has_pkgconfig() { have pkg-config; }
has_cmake() { have cmake; }
# Those of 1.3, and the library's name for linkers.
has_headers() {
  printf '#include <vulkan/vulkan.h>\nint main(void) { return VK_API_VERSION_1_3 == 0 || !vkCreateInstance; }\n' |
    cc -x c - -lvulkan -o /dev/null 2>/dev/null
}

# Ends the script unless a Rust is there that can build this package.
require_rust() {
  local wanted found
  if ! have cargo && [ -x "${CARGO_HOME:-${HOME:-}/.cargo}/bin/cargo" ]; then
    PATH="${CARGO_HOME:-${HOME:-}/.cargo}/bin:$PATH"
  fi
  wanted=$(sed -n 's/^rust-version *= *"\(.*\)"/\1/p' Cargo.toml)
  have cargo || stop "missing: Rust $wanted or later (cargo); how to get it: https://rustup.rs"
  found=$(rustc --version | cut -d ' ' -f 2)
  if [ "$(printf '%s\n' "$wanted" "$found" | sort -V | head -n 1)" != "$wanted" ]; then
    stop "Rust $found is too old, $wanted or later is needed; how to get it: rustup update, or https://rustup.rs"
  fi
}

# Installs whichever of the given needs are not there.
setup() { # needs…
  local need missing=()
  require_rust
  for need; do
    "has_$need" || missing+=("$need")
  done
  [ "${#missing[@]}" = 0 ] || install "${missing[@]}"
}

# --- the program and a device -----------------------------------------------------------------------------------------

# Cargo's progress belongs on a terminal; in a pipe only its errors do.
quiet_cargo=()
[ -t 2 ] || quiet_cargo=(--quiet)

# Builds what the arguments name, in one go: built apart, dependencies whose features tests extend compile twice.
build() { # cargo build's arguments
  say "building (minutes the first time, seconds later)"
  cargo build "${quiet_cargo[@]}" --release --locked "$@"
}

# Where build puts what it makes.
target_directory=
find_target() {
  [ -n "$target_directory" ] ||
    target_directory=$(cargo metadata --format-version 1 --no-deps --locked |
      sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
}

# Runs the program that build made, as it lies: `cargo run` would first build it again with other features.
cao() {
  find_target
  "$target_directory/release/cao" "$@"
}

# Whether a device answers that lacks nothing.
has_device() { cao devices --json 2>/dev/null | grep '"missing": *\[\]' >/dev/null; }

# Sees to it that one does; after build, because the program itself is asked.
setup_device() {
  if has_device; then return 0; fi
  if have apt-get && may_install; then
    say "no usable Vulkan device answers; a software driver will do"
    install_software_driver
  else
    stop_missing driver
  fi
  if has_device; then return 0; fi
  # Let the program speak: its reason is the user's only clue.
  cao devices >&2 || true
  stop "no usable Vulkan device answers, not even the software driver just installed"
}

# Mesa's software driver runs this program's kernels about three times faster from version 25 on, so an older
# candidate is passed over if the distribution's backports have a newer one.
install_software_driver() {
  apt_refresh
  local candidate
  candidate=$(apt-cache policy mesa-vulkan-drivers | awk '$1 == "Candidate:" { print $2 }')
  case $candidate in
  [0-9]*) if dpkg --compare-versions "$candidate" lt 25 && install_driver_from_backports; then return 0; fi ;;
  esac
  install driver
}

install_driver_from_backports() {
  local suite added=
  suite=$(. /etc/os-release && [ "${ID:-}" = debian ] && echo "${VERSION_CODENAME:-}-backports")
  [ -n "$suite" ] && [ "$suite" != -backports ] || return 1
  if ! apt_knows "$suite"; then added=$(add_backports "$suite") || true; fi
  if apt_knows "$suite"; then
    say "installing mesa-vulkan-drivers from $suite"
    if quietly apt install -t "$suite" mesa-vulkan-drivers; then return 0; fi
  fi
  say "no driver to be had from $suite; taking the default one"
  [ -z "$added" ] || as_root rm -f "$added"
  return 1
}

# Whether a suite's package lists are there: configured and fetched.
# shellcheck disable=SC2016 # the $(…) are apt's
apt_knows() { # suite
  [ -n "$(apt-get indextargets --format '$(REPO_URI)' \
    'Created-By: Packages' "Codename: $1" 'Origin: Debian Backports')" ]
}

# Prints the distribution's own source with another suite in the place of its own, copying whatever it says besides (address, key,
# components, options), so that a mirror stays a mirror.
# shellcheck disable=SC2016 # the $(…) are apt's
source_for_suite() { # suite
  local codename entry
  codename=$(. /etc/os-release && echo "${VERSION_CODENAME:-}")
  entry=$(apt-get indextargets --format '$(SOURCESENTRY)' \
    'Created-By: Packages' "Codename: $codename" 'Origin: Debian' 'Component: main' | head -n 1)
  # The number counts stanzas in a deb822 file, lines in a classic one.
  local file=${entry%:*} number=${entry##*:}
  [ -r "$file" ] || return 1
  case $file in
  *.sources) stanza_for_suite "$file" "$number" "$1" ;;
  *) sed -n "${number}p" "$file" | sed -E "s/^(deb +(\[[^]]*\] +)?[^ ]+ +)[^ ]+/\1$1/" ;;
  esac
}
# What the name of a file with this source ends in.
source_extension() { # source
  case $1 in deb\ *) echo list ;; *) echo sources ;; esac
}

# Adds the backports suite beside the distribution's own source. Prints the file it made; leaves none behind on failure.
add_backports() { # suite
  local made text
  text=$(source_for_suite "$1") || return 1
  made=/etc/apt/sources.list.d/cao-backports.$(source_extension "$text")
  say "adding $1 as $made"
  as_root tee "$made" <<<"$text" >/dev/null || return 1
  # Only the new file is read: fast, and no other source can make this fail. A suite that does not exist is no news.
  if apt update -o Dir::Etc::SourceList="$made" -o Dir::Etc::SourceParts=/dev/null \
    -o APT::Get::List-Cleanup=0 -o APT::Update::Error-Mode=any >/dev/null 2>&1 </dev/null; then
    echo "$made"
  else
    as_root rm -f "$made"
    return 1
  fi
}

# Prints the n-th deb822 stanza of a file with its suites replaced, without comments.
stanza_for_suite() { # file, n, suite
  awk -v n="$2" -v suite="$3" '
    /^#/ { next }
    /^[ \t]*$/ { if (inside) stanzas++; inside = 0; next }
    { inside = 1 }
    !/^[ \t]/ { of_suites = tolower($0) ~ /^suites:/; if (of_suites) $0 = "Suites: " suite }
    /^[ \t]/ && of_suites { next } # suites on further lines
    stanzas == n - 1' "$1"
}
