"""PNG files of drawings in few colours: a third of the size, the same to the eye."""

from io import BytesIO

from PIL import Image

COLOURS = 128


def shrink(png: bytes, width: int | None = None) -> bytes:
    """The picture with a palette, as it was where that is no smaller or it has one. width: pixels to scale it down to.

    The bytes depend on the pixels and the version of Pillow alone.
    """
    picture = Image.open(BytesIO(png))
    if picture.mode == "P":
        return png
    picture = picture.convert("RGB")
    if width is not None and width < picture.width:
        picture = picture.resize((width, round(width * picture.height / picture.width)), Image.Resampling.LANCZOS)
    written = BytesIO()
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(written, "PNG", optimize=True)
    return written.getvalue() if width is not None or written.tell() < len(png) else png
