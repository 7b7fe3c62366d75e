"""Folders of a file system that is mounted read-only, as that of a cluster's image is."""

import subprocess

import pytest

_MOUNT = 'mount --bind "$0" "$0" && mount -o remount,bind,ro "$0" && exec "$@"'


def with_read_only(folder):
    """Return the words before a command that runs with a folder mounted read-only."""
    words = ["unshare", "-rm", "sh", "-c", _MOUNT, folder]
    if subprocess.run([*words, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this system lets nobody mount a folder read-only")
    return words
