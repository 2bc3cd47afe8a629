"""What HIRO's links and camera look like: plain primitives within their solids; metres, degrees.

An own drawing; only the left side is listed. A link that is not listed is drawn as its solid.
"""

from __future__ import annotations

from emd_arm_executor.hiro.figures.records import Shape, Vector

COLOURS: dict[str, tuple[float, float, float]] = {
    "white": (0.93, 0.93, 0.91),
    "grey": (0.60, 0.62, 0.64),
    "dark": (0.24, 0.25, 0.27),
    "black": (0.07, 0.07, 0.08),
    "glass": (0.22, 0.26, 0.30),
    "amber": (0.95, 0.62, 0.15),
    "steel": (0.76, 0.78, 0.80),
}

_ALONG_X: Vector = (0, 90, 0)
_ALONG_Y: Vector = (90, 0, 0)

_CHEST = (
    Shape("cylinder", (0.105, 0.05), (-0.035, 0, 0.252), "dark"),
    Shape("box", (0.19, 0.25, 0.06), (-0.035, 0, 0.290), "grey"),
    Shape("box", (0.215, 0.31, 0.18), (-0.032, 0, 0.400), "white"),
    Shape("box", (0.008, 0.20, 0.09), (0.078, 0, 0.400), "grey"),
    Shape("box", (0.004, 0.055, 0.012), (0.083, 0.055, 0.425), "amber"),
    Shape("cylinder", (0.040, 0.440), (-0.025, 0, 0.514), "white", _ALONG_Y),
    Shape("box", (0.13, 0.30, 0.065), (-0.035, 0, 0.505), "white"),
    Shape("box", (0.065, 0.27, 0.26), (-0.150, 0, 0.400), "dark"),
    Shape("cylinder", (0.038, 0.020), (0, 0, 0.546), "dark"),
)

_HEAD = (
    Shape("box", (0.200, 0.190, 0.085), (-0.030, 0, 0.080), "white"),
    Shape("box", (0.030, 0.170, 0.075), (0.083, 0, 0.081), "black"),
    Shape("cylinder", (0.020, 0.004), (0.099, 0.0698, 0.092), "glass", _ALONG_X),
    Shape("cylinder", (0.020, 0.004), (0.099, -0.0698, 0.092), "glass", _ALONG_X),
    Shape("cylinder", (0.030, 0.218), (-0.045, 0, 0.075), "grey", _ALONG_Y),
    # The mast that carries the camera.
    Shape("box", (0.030, 0.060, 0.075), (0.005, 0, 0.155), "dark"),
)

_KINECT = (
    Shape("box", (0.060, 0.276, 0.038), (-0.040, 0, 0.006), "black"),
    Shape("box", (0.055, 0.075, 0.022), (-0.040, 0, -0.022), "black"),
    Shape("cylinder", (0.010, 0.004), (-0.009, 0, 0.006), "glass", _ALONG_X),
    Shape("cylinder", (0.010, 0.004), (-0.009, -0.030, 0.006), "glass", _ALONG_X),
    Shape("cylinder", (0.010, 0.004), (-0.009, 0.075, 0.006), "glass", _ALONG_X),
    Shape("box", (0.003, 0.012, 0.004), (-0.010, -0.075, 0.006), "amber"),
)

LOOKS: dict[str, tuple[Shape, ...]] = {
    "CHEST_JOINT0_Link": _CHEST,
    "HEAD_JOINT1_Link": _HEAD,
    "camera_link": _KINECT,
    "LARM_JOINT0_Link": (
        Shape("cylinder", (0.043, 0.150), (0, 0.007, 0.017), "grey"),
        Shape("cylinder", (0.036, 0.060), (0, 0.025, 0), "dark", _ALONG_Y),
    ),
    "LARM_JOINT1_Link": (
        Shape("cylinder", (0.050, 0.085), (0, 0.095, 0), "white", _ALONG_Y),
        Shape("cylinder", (0.042, 0.190), (-0.012, 0.105, -0.115), "white"),
        Shape("cylinder", (0.044, 0.070), (0, 0.110, -0.248), "dark", _ALONG_Y),
        Shape("cylinder", (0.045, 0.006), (-0.012, 0.105, -0.070), "amber"),
    ),
    "LARM_JOINT2_Link": (
        Shape("cylinder", (0.035, 0.080), (0, 0.005, 0), "grey", _ALONG_Y),
        Shape("cylinder", (0.039, 0.090), (-0.030, 0, -0.062), "white"),
        Shape("cylinder", (0.036, 0.045), (-0.030, 0, -0.127), "dark"),
    ),
    "LARM_JOINT3_Link": (
        Shape("cylinder", (0.037, 0.080), (0, 0.004, -0.180), "white"),
        Shape("cylinder", (0.028, 0.060), (0, 0.025, -0.230), "dark", _ALONG_Y),
    ),
    "LARM_JOINT4_Link": (
        Shape("cylinder", (0.032, 0.090), (0, 0.022, -0.003), "grey", _ALONG_Y),
        Shape("box", (0.055, 0.062, 0.070), (-0.004, 0.010, -0.055), "white"),
        Shape("cylinder", (0.026, 0.045), (-0.012, 0, -0.088), "dark", _ALONG_X),
    ),
    "LARM_JOINT5_Link": (
        Shape("cylinder", (0.028, 0.030), (0.012, 0, 0), "grey", _ALONG_X),
        Shape("box", (0.040, 0.084, 0.060), (-0.017, 0, -0.014), "dark"),
        Shape("box", (0.012, 0.060, 0.034), (-0.032, 0, 0), "grey"),
    ),
}
