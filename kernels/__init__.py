"""The compiled core: flow, terrain, cost; stream value, motion; controls; flights; edges by three methods.

Kernels trust their arguments: `glider_stream.roadmap.evaluator` is the one place that casts, checks and raises.
"""
