"""All figures that the README claims. Usage: python -m benchmarks.run"""

from __future__ import annotations

from benchmarks import accuracy, device, lookup, physics, robustness, scaling, speed, tracking


def main() -> None:
    accuracy.main()
    speed.main()
    scaling.main()
    robustness.main()
    lookup.main()
    tracking.main()
    device.main()
    physics.main()


if __name__ == "__main__":
    main()
