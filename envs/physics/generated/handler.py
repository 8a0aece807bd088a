"""The function that XLA calls to launch a kernel, in LLVM IR: no C compiler is needed on this machine.

XLA calls foreign functions through a C interface. Its structures, which are read here by offset, are declared
in jaxlib's header (`jax.ffi.include_dir()`). Minor versions of the interface only append to them.
"""

import ctypes
import re
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import jax

HEADER = "xla/ffi/api/c_api.h"
KNOWN_MAJOR = 0
METADATA_EXTENSION = 1  # type of the extension of a call that asks for the version and the traits
IN_COMMAND_BUFFERS = 1  # the trait of a function whose launches XLA may record and repeat
INTERNAL_ERROR = 13
FAILED = "the generated physics could not be launched: train with env.physics=mjx"
# Offsets in bytes. Of a call's frame:
EXTENSION, API, CONTEXT, ARGUMENTS, RESULTS = 8, 16, 24, 72, 112
# Of an extension, of metadata, of the functions of the interface, of a buffer, of a request for the stream:
TYPE, METADATA_POINTER = 8, 24
MAJOR, MINOR, TRAITS = 24, 28, 32
CREATE_ERROR, GET_STREAM = 48, 80
DATA = 24
REQUEST_CONTEXT, STREAM = 16, 24


class Launch(NamedTuple):
    """Launch parameters of a kernel. Its arguments are pointers to the inputs, then to the outputs."""

    inputs: int
    outputs: int
    blocks: int
    threads: int  # in a block


@cache
def version() -> tuple[int, int]:
    """Major and minor version of XLA's interface, from the header of this jaxlib."""
    text = (Path(jax.ffi.include_dir()) / HEADER).read_text()
    major, minor = (re.search(rf"define XLA_FFI_API_{part} (\d+)", text) for part in ("MAJOR", "MINOR"))
    return (int(major[1]), int(minor[1])) if major and minor else (-1, -1)


LAUNCHER = ctypes.CFUNCTYPE(  # as `cuLaunchKernel`
    ctypes.c_int,
    ctypes.c_void_p,
    *[ctypes.c_uint] * 7,
    ctypes.c_void_p,
    ctypes.POINTER(ctypes.POINTER(ctypes.c_void_p)),
    ctypes.c_void_p,
)
_NO_HANDLE = ctypes.c_void_p(1)  # for a kernel that needs no loading


def address_of(function: Any) -> int:
    """Address of a function of ctypes."""
    return int(ctypes.cast(function, ctypes.c_void_p).value or 0)


def compiled(
    launch: Launch,
    launcher: int,
    slot: int = ctypes.addressof(_NO_HANDLE),
    wait: int = 0,
    on_stream: bool = True,
) -> tuple[object, int]:
    """The engine that owns the function's machine code, and the function's address.

    Args:
        launch: launch parameters of the kernel.
        launcher: address of a function with the signature of `cuLaunchKernel`.
        slot: address of the kernel's handle, which is 0 until the kernel is loaded.
        wait: address of a function without arguments, called while the handle is 0; returns when loaded.
        on_stream: whether there is a stream, as on a GPU.
    """
    from llvmlite import binding  # may be missing

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    module = binding.parse_assembly(_text(launch, launcher, slot, wait, on_stream))
    machine = binding.Target.from_default_triple().create_target_machine(jit=True)
    engine = binding.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    return engine, engine.get_function_address("handler")


def capsule(address: int) -> object:
    """A function at an address, for `jax.ffi.register_ffi_target`."""
    return jax.ffi.pycapsule(ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p)(address))


def _text(launch: Launch, launcher: int, slot: int, wait: int, on_stream: bool) -> str:
    buffers = [f"arguments {k}" for k in range(launch.inputs)] + [
        f"results {k}" for k in range(launch.outputs)
    ]
    grid = f"i32 {launch.blocks}, i32 1, i32 1, i32 {launch.threads}, i32 1, i32 1, i32 0"
    major, minor = version()
    return f"""
@message = private constant [{len(FAILED) + 1} x i8] c"{FAILED}\\00"

define ptr @handler(ptr %frame) {{
  {_field("extension", "frame", EXTENSION)}
  %is_call = icmp eq ptr %extension, null
  br i1 %is_call, label %call, label %extended
extended:
  {_field("type", "extension", TYPE, "i32")}
  %is_question = icmp eq i32 %type, {METADATA_EXTENSION}
  br i1 %is_question, label %question, label %call
question:
  {_field("found", "extension", METADATA_POINTER)}
  {_set("found", MAJOR, f"i32 {major}")}
  {_set("found", MINOR, f"i32 {minor}")}
  {_set("found", TRAITS, f"i32 {IN_COMMAND_BUFFERS}")}
  ret ptr null
call:
  {_field("api", "frame", API)}
  {_field("arguments", "frame", ARGUMENTS)}
  {_field("results", "frame", RESULTS)}
  %pointers = alloca ptr, i64 {len(buffers)}
  %parameters = alloca ptr, i64 {len(buffers)}
  {"".join(_parameter(k, *buffer.split()) for k, buffer in enumerate(buffers))}
  {_STREAM if on_stream else "%stream = inttoptr i64 0 to ptr"}
  %slot = inttoptr i64 {slot} to ptr
  %early = load atomic ptr, ptr %slot acquire, align 8
  %is_loaded = icmp ne ptr %early, null
  br i1 %is_loaded, label %launch, label %waiting
waiting:
  %wait = inttoptr i64 {wait} to ptr
  call void %wait()
  br label %launch
launch:
  %kernel = load atomic ptr, ptr %slot acquire, align 8
  %launcher = inttoptr i64 {launcher} to ptr
  %status = call i32 %launcher(ptr %kernel, {grid}, ptr %stream, ptr %parameters, ptr null)
  %is_launched = icmp eq i32 %status, 0
  br i1 %is_launched, label %done, label %failed
done:
  ret ptr null
failed:
  %request = alloca {{i64, ptr, ptr, i32}}
  store {{i64, ptr, ptr, i32}} {{i64 32, ptr null, ptr @message, i32 {INTERNAL_ERROR}}}, ptr %request
  {_field("create_error", "api", CREATE_ERROR)}
  %error = call ptr %create_error(ptr %request)
  ret ptr %error
}}
"""


def _field(name: str, base: str, offset: int, kind: str = "ptr") -> str:
    """Lines that load a field of a structure into a value with this name."""
    address = f"%{name}_at"
    return f"{address} = getelementptr i8, ptr %{base}, i64 {offset}\n  %{name} = load {kind}, ptr {address}"


def _set(base: str, offset: int, value: str) -> str:
    """Lines that write a field of a structure."""
    field = f"%{base}_{offset}"
    return f"{field} = getelementptr i8, ptr %{base}, i64 {offset}\n  store {value}, ptr {field}"


def _parameter(number: int, array: str, index: str) -> str:
    """Lines that pass the address of a buffer's data as the kernel's parameter with this number."""
    return f"""{_field(f"buffer{number}", array, 8 * int(index))}
  {_field(f"data{number}", f"buffer{number}", DATA)}
  {_set("pointers", 8 * number, f"ptr %data{number}")}
  {_set("parameters", 8 * number, f"ptr %pointers_{8 * number}")}
  """


_STREAM = f"""%stream_request = alloca {{i64, ptr, ptr, ptr}}
  store {{i64, ptr, ptr, ptr}} {{i64 32, ptr null, ptr null, ptr null}}, ptr %stream_request
  {_field("context", "frame", CONTEXT)}
  {_set("stream_request", REQUEST_CONTEXT, "ptr %context")}
  {_field("get_stream", "api", GET_STREAM)}
  %refusal = call ptr %get_stream(ptr %stream_request)
  %is_given = icmp eq ptr %refusal, null
  br i1 %is_given, label %given, label %refused
refused:
  ret ptr %refusal
given:
  {_field("stream", "stream_request", STREAM)}"""
