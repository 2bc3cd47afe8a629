"""Names of the topics on which an RGB-D camera is listened to."""

from sensor_msgs.msg import Image, PointCloud2

from emd_perception.frame_input import DepthSource

COLOUR = "camera/color/image_raw"
INFO = "camera/color/camera_info"
POSE = "camera/pose"
DEPTH_INFO = "camera/depth/camera_info"  # of depth that is not registered

DEPTH = {
    DepthSource.REGISTERED: ("camera/depth_registered/image_raw", Image),
    DepthSource.UNREGISTERED: ("camera/depth/image_raw", Image),
    DepthSource.POINTS: ("camera/depth_registered/points", PointCloud2),
}
