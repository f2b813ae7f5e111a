"""What file managers, office programs and file systems leave in a folder that somebody looked at.

Nobody wrote such a file, so it is no scan and no part of a result, and stands in the way of none.
"""

NAMES = frozenset(
    {
        *(".ds_store", "__macosx"),  # Finder, and what it packs
        *("thumbs.db", "ehthumbs.db", "desktop.ini"),  # Windows
        ".directory",  # Dolphin
        "@eadir",  # network storage
    }
)
BEGINNINGS = (
    "._",  # attributes of a file on a disk that has no place for them
    *(".~lock.", "~$"),  # of a table that is open in LibreOffice or Excel
    *(".nfs", ".fuse_hidden"),  # of a file that was removed while it was open
)


def is_leftover(name: str) -> bool:
    """Tell whether a file or folder of that name is one that nobody wrote.

    Examples
    --------
    >>> [is_leftover(name) for name in (".DS_Store", "~$caps.xlsx", "caps.csv")]
    [True, True, False]
    """
    name = name.lower()
    return name in NAMES or name.startswith(BEGINNINGS)
