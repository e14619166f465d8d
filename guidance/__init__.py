"""Guidance: what to do with an information set, and what nature does against it."""

from guidance.game_noise import GameNoise
from guidance.noise import LineOfSight, Measurement, MeasurementNoise, NoiseKind, TieRule
from guidance.patient import Patient
from guidance.predicted_miss import symmetric_impulse, zero_effort_miss
from guidance.random_noise import RandomNoise
from guidance.registry import make_strategy, strategy_names
from guidance.scripted_noise import ScriptedNoise
from guidance.situation import Situation
from guidance.strategy import Strategy
from guidance.symmetric_miss import SymmetricMiss
from guidance.thruster import Thruster

__all__ = [
    "GameNoise",
    "LineOfSight",
    "Measurement",
    "MeasurementNoise",
    "NoiseKind",
    "Patient",
    "RandomNoise",
    "ScriptedNoise",
    "Situation",
    "Strategy",
    "SymmetricMiss",
    "Thruster",
    "TieRule",
    "make_strategy",
    "strategy_names",
    "symmetric_impulse",
    "zero_effort_miss",
]
