"""Pictures as data addresses, so that the page needs no other file."""

from __future__ import annotations

import io
from base64 import b64encode

from PIL import Image

KINDS = {".png": "image/png", ".svg": "image/svg+xml"}


def data_uri(data: bytes, suffix: str = ".png") -> str:
    """Return the file of a picture as an address; `suffix` is its kind."""
    return f"data:{KINDS[suffix]};base64,{b64encode(data).decode('ascii')}"


def png_uri(image: Image.Image) -> str:
    """Return a picture as the address of a PNG."""
    stream = io.BytesIO()
    image.save(stream, format="PNG")
    return data_uri(stream.getvalue())
