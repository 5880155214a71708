"""What terms mean, for the page of the glossary and for the help of the commands whose texts have them."""

from __future__ import annotations

import re

TERMS = {  # a meaning has only terms that come later
    "objective": "error: a small stated error; the paper's control robot flips every 2 s (with gears see "
    "--minimum-seconds); time: a short duration, every 7 s; flips: as few as --tolerance allows, every 12 s",
    "point of the robot": "on its axis: head_centre, head_tip, the front end of the head, or pivot",
    "stated error": "distance from the declared path that 95 of 100 such robots keep to, without feedback",
    "declared path": "the nearest path to the given one that the robot can follow; errors are distances from it",
    "dwell": "time between two flips of the motor",
    "flips": "reversals of the motor, the robot's only control input",
    "pivot": "the point of the axis that does not slip sideways",
    "Dubins path": "shortest path of bounded curvature between two poses: arcs of the smallest radius and "
    "straight lines",
    "domain": "the robots that a look-up table answers for",
    "free run": "a prediction of a trace from its start, without another look at its readings",
    "own number": "a number of a model that each trace, session or specimen has for itself (per=), such as the "
    "start of a cup that cools",
    "trace": "readings of one specimen in time, sorted; their noise may have a memory",
    "memory of the noise": "the part of the noise that is slow, s, and the time τ after which a reading has "
    "forgotten it by a factor of e",
    "verdict": "what a calibration concludes: no effect is missing, one is, a number is wrong, or the runs cannot "
    "decide",
    "preset": "a robot that comes with the package, such as paper-control",
    "law": "a place on the robot where an unknown term acts, and the inputs on which the term depends",
    "nuisance parameter": "a number of the robot or of the measurement that influences the prediction but is of "
    "no interest itself; it is fitted with a prior",
    "outlier": "a run that is excluded, because it is incompatible with the others and the noise",
    "score": "test statistic of an effect: the part of its signal that the fit cannot absorb, in standard "
    "deviations of the noise",
    "session": "runs that share a filling of the tank, a day, or a robot",
    "effect": "physics that the model may lack; softflagella effects lists those of a robot",
}


def terms_in(text: str) -> dict[str, str]:
    """Return the terms that a text has, with their meanings, and those that the meanings have."""
    meanings = {}
    for term, meaning in TERMS.items():
        if re.search(rf"\b{term}\b", " ".join(text.split()), re.IGNORECASE):
            meanings[term] = meaning
            text += f" {meaning}"
    return dict(sorted(meanings.items(), key=lambda item: item[0].lower()))
