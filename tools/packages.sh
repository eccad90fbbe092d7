# Sourced by the scripts in tools/: installs missing Debian or Ubuntu packages and checks for Rust.
# shellcheck shell=bash

# What is needed to build and run the program: a compiler; CMake and libclang for OpenVR's loader; shaderc and the libraries
# it is made of; Vulkan with a CPU driver; the libraries that a window loads. The sourcing scripts read these lists.
# shellcheck disable=SC2034
PACKAGES_TO_RUN=(g++ make cmake pkg-config libclang-dev libshaderc-dev glslang-dev spirv-tools libvulkan1 mesa-vulkan-drivers
    libxkbcommon0 libxkbcommon-x11-0 libx11-6 libx11-xcb1 libxcursor1 libxi6 libxrandr2 libwayland-client0)
# shellcheck disable=SC2034
PACKAGES_TO_TEST=(vulkan-validationlayers xvfb python3)
# shellcheck disable=SC2034
PACKAGES_TO_CHECK_WINDOWS=(rustc-web cargo-web rust-web-src gcc-mingw-w64-x86-64-posix g++-mingw-w64-x86-64-posix wine64
    xvfb xdotool imagemagick python3)

# Installs those of the given packages that are missing, and says which. Does nothing if all are installed.
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
    # On a terminal apt asks before it installs; without one, or in CI, nobody could answer.
    if [ ! -t 0 ] || [ -n "${CI:-}" ]; then
        yes=(-y)
    fi
    echo "Installing missing packages with apt-get: ${missing[*]}" >&2
    "${as_root[@]}" env DEBIAN_FRONTEND="${DEBIAN_FRONTEND:-noninteractive}" apt-get update -qq
    "${as_root[@]}" env DEBIAN_FRONTEND="${DEBIAN_FRONTEND:-noninteractive}" \
        apt-get install "${yes[@]}" -qq --no-install-recommends "${missing[@]}" >&2
}

# Finds cargo, also where rustup has just installed it and PATH does not name it yet.
find_cargo() {
    if ! command -v cargo >/dev/null && [ -x "$HOME/.cargo/bin/cargo" ]; then
        PATH="$HOME/.cargo/bin:$PATH"
    fi
    if ! command -v cargo >/dev/null; then
        echo "Rust is missing. Install it from https://rustup.rs (curl https://sh.rustup.rs -sSf | sh), then start again." >&2
        exit 1
    fi
}

# Gives cargo a shaderc that links. Debian's static shaderc does not contain glslang and SPIRV-Tools, which it calls, so they
# are merged into one archive. If that does not link, shaderc is built from source, which takes about ten minutes.
# The argument is the checkout's folder; only .cargo/ is written there, which git ignores.
prepare_shaderc() {
    local home=$1/.cargo from part
    if [ -n "${SHADERC_LIB_DIR:-}${VULKAN_SDK:-}" ] || ! command -v dpkg-query >/dev/null || [ -e "$home/config.toml" ]; then
        return
    fi
    from=/usr/lib/$(g++ -print-multiarch)
    mkdir -p "$home/shaderc"
    {
        echo "create libshaderc_combined.a"
        for part in shaderc_combined glslang MachineIndependent GenericCodeGen OSDependent OGLCompiler HLSL SPIRV \
            SPIRV-Tools-opt SPIRV-Tools; do
            # Newer versions of glslang have fewer libraries.
            [ ! -f "$from/lib$part.a" ] || echo "addlib $from/lib$part.a"
        done
        echo save
        echo end
    } | (cd "$home/shaderc" && ar -M) || true
    if ! links_shaderc "$home/shaderc"; then
        rm -f "$home/shaderc/libshaderc_combined.a"
        echo "shaderc's packages do not link here: building it from source, which takes about ten minutes." >&2
        install_packages cmake ninja-build python3
    fi
    printf '# Made by tools/packages.sh: the shaderc that build.rs links; without it, one is built from source.\n[env]\n%s\n' \
        'SHADERC_LIB_DIR = { value = ".cargo/shaderc", relative = true }' >"$home/config.toml"
    # An earlier build may have remembered another shaderc.
    rm -rf "$1"/target/*/build/shaderc-sys-* "$1"/target/*/.fingerprint/shaderc-sys-*
}

links_shaderc() {
    local program
    program=$(mktemp)
    echo '#include <shaderc/shaderc.h>
int main() { shaderc_compiler_release(shaderc_compiler_initialize()); }' |
        g++ -x c++ - -x none -o "$program" -L"$1" -lshaderc_combined -lpthread 2>/dev/null && "$program"
    local linked=$?
    rm -f "$program"
    return $linked
}
