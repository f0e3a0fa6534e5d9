"""The full equations of Saint-Venant, one dimension, between two dams with given flows."""

from rivid.reach.saint_venant.channel import Channel
from rivid.reach.saint_venant.flow import Flow, State, arrival_time, backwater_lift, fastest_wave, simulate

__all__ = ["Channel", "Flow", "State", "arrival_time", "backwater_lift", "fastest_wave", "simulate"]
