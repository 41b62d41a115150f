"""Formats that are no logs for this package: known by their first bytes, refused by name."""

from auv_fault_env.errors import InputError, refusal

AS_CSV = "export it as CSV or Parquet"
UNPACK = "unpack it and name the file inside"
PANDAS = "write it as Parquet with pandas (DataFrame.to_parquet)"
NUMPY = "write the arrays as CSV with numpy.savetxt"

# format and remedy by the first bytes
STARTS: dict[bytes, tuple[str, str]] = {
    b"\x89HDF\r\n\x1a\n": ("HDF5 (also NetCDF-4)", PANDAS),
    b"CDF\x01": ("NetCDF", PANDAS),
    b"CDF\x02": ("NetCDF", PANDAS),
    b"MATLAB ": ("MATLAB (.mat)", "write it as CSV with MATLAB's writetable"),
    b"\x93NUMPY": ("NumPy (.npy)", NUMPY),
    b"\xd0\xcf\x11\xe0": ("Excel (.xls)", "save it as CSV (UTF-8)"),
    b"ARROW1": ("Arrow or Feather", PANDAS),
    b"ORC": ("ORC", PANDAS),
    b"Obj\x01": ("Avro", PANDAS),
    b"TDSm": ("LabVIEW (.tdms)", AS_CSV),
    b"MDF     ": ("MDF", AS_CSV),
    b"LOGG": ("Vector BLF", AS_CSV),
    b"\xfd7zXZ\0": ("xz", UNPACK),
    b"BZh91AY&SY": ("bzip2", UNPACK),
    b"\x28\xb5\x2f\xfd": ("Zstandard", UNPACK),
    b"\x04\x22\x4d\x18": ("LZ4", UNPACK),
    b"7z\xbc\xaf\x27\x1c": ("7-Zip", UNPACK),
    b"Rar!": ("RAR", UNPACK),
    b"%PDF": ("PDF", "export the table as CSV where it was made"),
    b"\x80\x02": ("a Python pickle, which is code", PANDAS),
    b"\x80\x03": ("a Python pickle, which is code", PANDAS),
    b"\x80\x04": ("a Python pickle, which is code", PANDAS),
    b"\x80\x05": ("a Python pickle, which is code", PANDAS),
}
# of an archive of type ZIP, by what its first entries are called
ZIP_START = b"PK\x03\x04"
ZIPPED: dict[bytes, tuple[str, str]] = {
    b"opendocument.spreadsheet": ("OpenDocument (.ods)", "save it as CSV (UTF-8)"),
    b"[Content_Types].xml": ("Excel (.xlsx)", "save it as CSV (UTF-8)"),
    b"xl/": ("Excel (.xlsx)", "save it as CSV (UTF-8)"),
    b".npy": ("NumPy (.npz)", NUMPY),
}
TAR_MARK = b"ustar"
TAR_PLACE = 257
START = 4096  # bytes that show the format


def foreign_format(start: bytes, log: str) -> InputError | None:
    """The refusal of a file of a known format that is not read; None for any other file."""
    starts = (known for known in STARTS if start.startswith(known))
    # a text may begin like some of them, but has no zero byte
    is_binary = b"\0" in start or not start.isascii()
    found = next((STARTS[known] for known in starts if is_binary), None)
    if start.startswith(ZIP_START):
        found = next((ZIPPED[mark] for mark in ZIPPED if mark in start), ("ZIP", UNPACK))
    if start[TAR_PLACE:].startswith(TAR_MARK):
        found = ("tar", UNPACK)
    if found is None:
        return None
    kind, remedy = found
    allowed = "text, gzip, Parquet, MCAP, a ROS bag, ULog, DataFlash (.BIN) or .tlog"
    return refusal("log", f"{log}: {kind}", allowed, remedy)
