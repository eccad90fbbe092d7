# Sourced by tools/run and tools/test: installs missing Debian or Ubuntu packages, and checks for Rust.
# shellcheck shell=bash

# What the program needs to be built and to run: compiler and CMake (shaderc), Vulkan with a CPU driver, the libraries that a window loads.
# The two sourcing scripts read these lists.
# shellcheck disable=SC2034
PACKAGES_TO_RUN=(g++ cmake ninja-build pkg-config python3 libshaderc-dev libvulkan1 mesa-vulkan-drivers
    libxkbcommon0 libxkbcommon-x11-0 libx11-6 libx11-xcb1 libxcursor1 libxi6 libxrandr2 libwayland-client0)
# shellcheck disable=SC2034
PACKAGES_TO_TEST=(vulkan-validationlayers xvfb xauth xdotool)

# Installs those of the named packages that are missing; says so in one line; does nothing when all are there.
install_packages() {
    if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
        echo "No apt here. If the build or the start fails, install what these Debian packages hold: $*" >&2
        return
    fi
    local missing=() package
    for package in "$@"; do
        case "$(dpkg-query -W -f='${Status}' "$package" 2>/dev/null)" in
            *" installed") ;;
            *) missing+=("$package") ;;
        esac
    done
    if [ ${#missing[@]} -eq 0 ]; then
        return
    fi
    local as_root=() yes=()
    if [ "$(id -u)" -ne 0 ]; then
        if ! command -v sudo >/dev/null; then
            echo "Missing packages; as root: apt-get install ${missing[*]}" >&2
            exit 1
        fi
        as_root=(sudo)
    fi
    # Somebody who sits there is asked by apt; a machine is not.
    if [ ! -t 0 ] || [ -n "${CI:-}" ]; then
        yes=(-y)
    fi
    echo "Installing missing packages with apt-get: ${missing[*]}" >&2
    "${as_root[@]}" env DEBIAN_FRONTEND="${DEBIAN_FRONTEND:-noninteractive}" apt-get update -qq
    "${as_root[@]}" env DEBIAN_FRONTEND="${DEBIAN_FRONTEND:-noninteractive}" \
        apt-get install "${yes[@]}" -qq --no-install-recommends "${missing[@]}" >&2
}

# Finds cargo, also where rustup has just put it.
find_cargo() {
    if ! command -v cargo >/dev/null && [ -x "$HOME/.cargo/bin/cargo" ]; then
        PATH="$HOME/.cargo/bin:$PATH"
    fi
    if ! command -v cargo >/dev/null; then
        echo "Rust is missing. Install it from https://rustup.rs (curl https://sh.rustup.rs -sSf | sh), then start again." >&2
        exit 1
    fi
}
