"""The published figures of HIRO that its model is built from; metres, kilograms, degrees.

Frames: WAIST has x forward, y left, z up. At zero angles every joint frame is parallel to WAIST,
except that each arm is rolled by 15 degrees about x at its root. Only the left side is listed; the
right side mirrors it in y.
"""
