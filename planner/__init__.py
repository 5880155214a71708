"""Planner: from a path in the plane to the motor's switching times, without simulating."""

from planner.paths.path import Path2D, circle, polygon
from planner.planning.plan import Plan, plan

__all__ = ["Path2D", "Plan", "circle", "plan", "polygon"]
