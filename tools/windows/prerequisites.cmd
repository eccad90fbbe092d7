@echo off
rem Called by tools\run.cmd and tools\test.cmd: looks for what a build on Windows needs; names the winget package of each one missing.
rem Whether a program is there is asked by starting it: Windows puts a python.exe on every PATH that only opens the Store.
set "PBR_VR_MISSING="

cargo --version >nul 2>nul
if errorlevel 1 call :missing "Rust" "Rustlang.Rustup"
cmake --version >nul 2>nul
if errorlevel 1 call :missing "CMake" "Kitware.CMake"

set "PBR_VR_VSWHERE=%ProgramFiles(x86)%\Microsoft Visual Studio\Installer\vswhere.exe"
set "PBR_VR_TOOLS=Microsoft.VisualStudio.Component.VC.Tools.x86.x64"
set "PBR_VR_FOUND="
if not exist "%PBR_VR_VSWHERE%" goto no_msvc
rem It prints where they are, or nothing.
set "PBR_VR_ANSWER=%TEMP%\pbr-vr-msvc.txt"
"%PBR_VR_VSWHERE%" -products * -requires %PBR_VR_TOOLS% -property installationPath >"%PBR_VR_ANSWER%"
for %%F in ("%PBR_VR_ANSWER%") do if %%~zF gtr 0 set "PBR_VR_FOUND=yes"
del "%PBR_VR_ANSWER%"
:no_msvc
if not defined PBR_VR_FOUND (
    call :missing "MSVC, from Visual Studio Build Tools" "Microsoft.VisualStudio.2022.BuildTools --override ^^"
    echo         "--wait --passive --add Microsoft.VisualStudio.Workload.VCTools --includeRecommended"
)

rem bindgen loads libclang.dll.
set "PBR_VR_FOUND=%LIBCLANG_PATH%"
if exist "%ProgramFiles%\LLVM\bin\libclang.dll" set "PBR_VR_FOUND=yes"
clang --version >nul 2>nul
if not errorlevel 1 set "PBR_VR_FOUND=yes"
if not defined PBR_VR_FOUND call :missing "LLVM (libclang)" "LLVM.LLVM"

rem The Vulkan SDK brings shaderc; without it, shaderc is built with Ninja and Python.
if defined VULKAN_SDK goto done
ninja --version >nul 2>nul
if errorlevel 1 goto no_shaderc
python --version >nul 2>nul
if errorlevel 1 goto no_shaderc
goto done
:no_shaderc
call :missing "Vulkan SDK (or else Ninja-build.Ninja and Python.Python.3.12)" "KhronosGroup.VulkanSDK"

:done
if not defined PBR_VR_MISSING exit /b 0
echo Install these, then start again in a new console.
exit /b 1

:missing
if not defined PBR_VR_MISSING echo Missing:
set "PBR_VR_MISSING=yes"
echo   %~1
echo     winget install %~2
exit /b 0
