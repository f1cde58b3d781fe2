# What .ci/run needs on Windows besides the bash of Git: python3, and .venv/bin, which is .venv/Scripts there.
$ErrorActionPreference = "Stop"
$python = (Get-Command python).Source
$python3 = Join-Path (Split-Path $python) "python3.exe"
if (-not (Test-Path $python3)) { Copy-Item $python $python3 }
& $python -m venv .venv
if ($LASTEXITCODE -ne 0) { exit $LASTEXITCODE }
New-Item -ItemType Junction -Path .venv/bin -Target (Resolve-Path .venv/Scripts) | Out-Null
