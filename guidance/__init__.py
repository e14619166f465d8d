"""Guidance: strategies that turn an information set into impulses, the thruster, and measurement noise."""

from guidance.estimate import MissEstimate
from guidance.game_noise import GameNoise
from guidance.kalman import Kalman, KalmanBank
from guidance.least_effort import LeastEffort
from guidance.noise import LineOfSight, MeasurementNoise, NoiseKind, TieRule
from guidance.patient import Patient
from guidance.predictive import Predictive
from guidance.proportional_navigation import ProportionalNavigation
from guidance.registry import make_strategy, strategy_names
from guidance.scripted_noise import RandomNoise, ScriptedNoise
from guidance.situation import Situation
from guidance.strategy import Strategy
from guidance.symmetric_impulse import symmetric_impulse
from guidance.symmetric_miss import SymmetricMiss
from guidance.thruster import Thruster
from guidance.zero_effort import ZeroEffortMiss

__all__ = [
    "GameNoise",
    "Kalman",
    "KalmanBank",
    "LeastEffort",
    "LineOfSight",
    "MeasurementNoise",
    "MissEstimate",
    "NoiseKind",
    "Patient",
    "Predictive",
    "ProportionalNavigation",
    "RandomNoise",
    "ScriptedNoise",
    "Situation",
    "Strategy",
    "SymmetricMiss",
    "Thruster",
    "TieRule",
    "ZeroEffortMiss",
    "make_strategy",
    "strategy_names",
    "symmetric_impulse",
]
