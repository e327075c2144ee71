"""Pages in a browser, of a run or of its recording: the server and the views (extra `web`)."""

from thenar.drivers.extras import optional

with optional():
    import aiohttp  # noqa: F401
