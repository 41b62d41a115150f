"""How large a log may be: what is beyond is refused before it fills the memory."""

from auv_fault_env.errors import refusal

LARGEST_CONTENT = 256 << 20  # bytes of a log that is read whole, unpacked
LARGEST_TABLE = 1 << 26  # numbers of a table, 512 MiB
SPLIT = "split it, or export fewer columns"


def check_content(log: str, size: int, remedy: str = SPLIT) -> None:
    """Refuse a log of more bytes, unpacked, than `LARGEST_CONTENT`."""
    if size > LARGEST_CONTENT:
        allowed = f"at most {LARGEST_CONTENT >> 20} MiB, unpacked"
        raise refusal("log", f"{log}: {size >> 20} MiB", allowed, remedy)


def check_table(log: str, n_rows: int, n_columns: int, remedy: str = SPLIT) -> None:
    """Refuse a table of more numbers than `LARGEST_TABLE`."""
    if n_rows * n_columns > LARGEST_TABLE:
        got = f"{log}: {n_rows} rows of {n_columns} columns"
        raise refusal("log", got, f"at most {LARGEST_TABLE} numbers", remedy)
