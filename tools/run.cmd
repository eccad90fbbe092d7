@echo off
rem Builds pbr-vr and runs it with the given arguments, in the folder it was called from; says what is missing first.
setlocal
call "%~dp0windows\prerequisites.cmd"
if errorlevel 1 exit /b 1
rem Cargo looks for its settings (.cargo) where it is started.
pushd "%~dp0.."
cargo build --release --locked --bin pbr-vr --target-dir target
if errorlevel 1 (
    popd
    exit /b 1
)
popd
"%~dp0..\target\release\pbr-vr.exe" %*
