"""Guidance: strategies, which turn an information set into impulses, thruster and noises."""

from infoset.guidance.estimate import MissEstimate
from infoset.guidance.game_noise import GameNoise
from infoset.guidance.kalman import Kalman, KalmanBank
from infoset.guidance.least_effort import LeastEffort
from infoset.guidance.noise import LineOfSight, MeasurementNoise, TieRule
from infoset.guidance.noise_registry import NoiseKind
from infoset.guidance.patient import Patient
from infoset.guidance.predictive import Predictive
from infoset.guidance.proportional_navigation import ProportionalNavigation
from infoset.guidance.registry import make_strategy, strategy_names
from infoset.guidance.scripted_noise import RandomNoise, ScriptedNoise
from infoset.guidance.situation import Situation
from infoset.guidance.strategy import Strategy
from infoset.guidance.symmetric_impulse import symmetric_impulse
from infoset.guidance.symmetric_miss import SymmetricMiss
from infoset.guidance.thruster import Thruster
from infoset.guidance.zero_effort import ZeroEffortMiss

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
