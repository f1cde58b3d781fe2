"""S3 server on this machine, for the tests of object stores."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import fsspec
import pytest
from moto.server import ThreadedMotoServer

__all__ = ["s3_server"]


@contextmanager
def s3_server(patch: pytest.MonkeyPatch, bucket: str) -> Iterator[str]:
    """Start a server with a bucket, tell the environment of it, and yield the bucket's address."""
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    _, port = server.get_host_and_port()
    for name, value in (
        ("AWS_ACCESS_KEY_ID", "testing"),
        ("AWS_SECRET_ACCESS_KEY", "testing"),
        ("AWS_DEFAULT_REGION", "us-east-1"),
        ("AWS_ENDPOINT_URL", f"http://127.0.0.1:{port}"),
    ):
        patch.setenv(name, value)
    fsspec.get_filesystem_class("s3").clear_instance_cache()  # instances for an earlier server
    fsspec.filesystem("s3").mkdir(bucket)
    try:
        yield f"s3://{bucket}"
    finally:
        server.stop()
