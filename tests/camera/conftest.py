"""Pictures and films need OpenCV."""

from __future__ import annotations

import pytest

pytest.importorskip("cv2", reason="the extra camera is not installed")
