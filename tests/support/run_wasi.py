"""Run a WebAssembly program for WASI in wasmtime: ``python run_wasi.py PROGRAM``."""

import sys

import wasmtime


def run(path: str) -> int:
    """Run a program, with this process's standard output; return its exit status."""
    store = wasmtime.Store()
    linker = wasmtime.Linker(store.engine)
    linker.define_wasi()
    wasi = wasmtime.WasiConfig()
    wasi.inherit_stdout()
    wasi.inherit_stderr()
    store.set_wasi(wasi)
    start = linker.instantiate(store, wasmtime.Module.from_file(store.engine, path)).exports(store)["_start"]
    assert isinstance(start, wasmtime.Func)
    try:
        start(store)
    except wasmtime.ExitTrap as end:
        return int(end.code)
    return 0


if __name__ == "__main__":
    sys.exit(run(sys.argv[1]))
