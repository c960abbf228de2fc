"""Drawing with matplotlib, an optional extra: imported on demand, in one style, saved as reproducible bytes."""

from __future__ import annotations

import importlib
import io
from contextlib import AbstractContextManager
from typing import Any, Literal, get_args

from evoclaims.core.errors import UserError, require_known

Format = Literal["svg", "png"]


def optional(module: str) -> Any:
    """Import a module of the extra `pictures`; if missing, a `UserError` says how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise UserError(
            f'{module.partition(".")[0]} is not installed, which pictures need: pip install "evoclaims[pictures]".'
        ) from error


def own_style(**settings: Any) -> AbstractContextManager[None]:
    """Draw or save with matplotlib's defaults and these settings, ignoring the user's own style.

    Raises:
        UserError: when matplotlib is not installed.
    """
    settings = {"svg.hashsalt": "evoclaims", "svg.fonttype": "none", **settings}
    style: AbstractContextManager[None] = optional("matplotlib.style").context(settings, after_reset=True)
    return style


def saved(figure: Any, file_format: str, title: str | None = None, **options: Any) -> bytes:
    """Return the contents of a picture's file, without a date; `options` go to matplotlib's `savefig`.

    Raises:
        UnknownNameError: for a format not in `Format`.
    """
    require_known("format of a picture", file_format, get_args(Format))
    file, unsaid = io.BytesIO(), {"svg": "Date", "png": "Software"}[file_format]
    metadata = {unsaid: None, **({"Title": title} if title else {})}
    figure.savefig(file, format=file_format, metadata=metadata, **options)
    return file.getvalue()
