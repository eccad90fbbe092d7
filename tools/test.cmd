@echo off
rem Checks format, lints and all tests on this machine's own GPU; says what is missing first.
setlocal
call "%~dp0windows\prerequisites.cmd"
if errorlevel 1 exit /b 1
rem Every test of the GPU has its calls checked.
if not defined VULKAN_SDK (
    echo The tests need Vulkan's validation layer: winget install KhronosGroup.VulkanSDK
    exit /b 1
)
pushd "%~dp0.."
cargo fmt --check
if errorlevel 1 goto failed
cargo clippy --locked --all-targets -- -D warnings
if errorlevel 1 goto failed
cargo test --locked
if errorlevel 1 goto failed
popd
exit /b 0

:failed
popd
exit /b 1
