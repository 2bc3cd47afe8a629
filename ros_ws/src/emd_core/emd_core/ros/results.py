"""How an error becomes a result: a code and a text, never a dead node."""

from __future__ import annotations

import traceback
from typing import Any

from rclpy.node import Node

from emd_core.errors import CellError, ErrorCode


def set_error(result: Any, err: BaseException, node: Node) -> Any:
    """Fill `error_code` and `error_msg` of a result or response from an exception, and log it.

    An exception that is not a CellError is a fault of the cell: the log gets its traceback.
    """
    if isinstance(err, CellError):
        node.get_logger().warning(f"{err.code.name}: {err}")
        result.error_code, result.error_msg = int(err.code), str(err)
    else:
        node.get_logger().error("".join(traceback.format_exception(err)))
        result.error_code = int(ErrorCode.UNKNOWN)
        result.error_msg = (
            f"{type(err).__name__}: {err} (a fault of {node.get_name()}; see its log)"
        )
    return result
