/* Tessera's public services for C and C++: see docs/camera.md.
   Made from the Rust types by tests/end_to_end/interfaces/camera/camera_interface.rs; TESSERA_UPDATE=1 cargo test --test end_to_end camera_interface writes it. */
#ifndef TESSERA_H
#define TESSERA_H

#include <assert.h>
#include <stddef.h>
#include <stdint.h>

// An [`InertialRotation`]; all zero where the source has no gyroscope.
typedef struct tessera_RotationBits {
    // Unit quaternion `x y z w`, from the camera now to the camera at the start.
    double start_from_camera_xyzw[4];
    // Variance added about each axis since the start, radians².
    double variance_rad2;
    // Standard deviation of the constant error of the rate, radians per second.
    double bias_sigma_rad_per_s;
} tessera_RotationBits;
static_assert(sizeof(tessera_RotationBits) == 48, "the layout of RotationBits");
static_assert(offsetof(tessera_RotationBits, start_from_camera_xyzw) == 0, "the layout of RotationBits");
static_assert(offsetof(tessera_RotationBits, variance_rad2) == 32, "the layout of RotationBits");
static_assert(offsetof(tessera_RotationBits, bias_sigma_rad_per_s) == 40, "the layout of RotationBits");

// An [`UpDirection`]; all zero where the source has no accelerometer.
typedef struct tessera_UpBits {
    // Unit vector against gravity, in the camera's axes.
    double in_camera[3];
    // Standard deviation of its tilt about each horizontal axis, radians.
    double sigma_rad;
} tessera_UpBits;
static_assert(sizeof(tessera_UpBits) == 32, "the layout of UpBits");
static_assert(offsetof(tessera_UpBits, in_camera) == 0, "the layout of UpBits");
static_assert(offsetof(tessera_UpBits, sigma_rad) == 24, "the layout of UpBits");

#define TESSERA_CAMERA_FRAME "tessera.CameraFrame.v2"
// Header of an image on the service `camera`; the payload is depth and, packed behind it, colour
// (see [`FrameShape`]), in units of 16 bits.
typedef struct tessera_CameraFrame {
    // Any number that differs from one start of the publisher to the next.
    uint64_t session;
    // Counts the images of a session from 0 on, those that were not sent too.
    uint64_t index;
    // Time of the depth image, nanoseconds; rises from image to image.
    int64_t stamp_nanos;
    // 0: an image. 1: the camera has ended; the index is the number of images, and the payload is not read.
    // 2: an image with which relocalisation is asked for.
    uint32_t kind;
    // 1: the payload holds colour, else 0.
    uint32_t has_colour;
    // Columns, pixels.
    uint32_t width;
    // Rows, pixels.
    uint32_t height;
    // 0: live, nothing comes again. Else so many images are kept and sent again on request.
    uint32_t ring_frames;
    // 1: colour is registered to depth, pixel by pixel, else 0.
    uint32_t colour_registered;
    // Focal length along x, pixels; 0: the publisher does not know its camera, `--camera` gives it.
    double fx;
    // Focal length along y, pixels.
    double fy;
    // Principal point, column.
    double cx;
    // Principal point, row.
    double cy;
    // Raw depth divided by this is metres: 1000 for millimetres.
    double units_per_metre;
    // Brown-Conrady coefficients `k1 k2 p1 p2 k3`.
    double distortion[5];
    // Seconds from the exposure of the first depth row to that of the last; 0: global shutter.
    double readout_s;
    // Metres to add to every measured depth.
    double depth_offset_m;
    // The rotation that a gyroscope measured; all zero without one.
    tessera_RotationBits rotation;
    // The direction against gravity; all zero where it is not known.
    tessera_UpBits up;
} tessera_CameraFrame;
static_assert(sizeof(tessera_CameraFrame) == 224, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, session) == 0, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, index) == 8, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, stamp_nanos) == 16, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, kind) == 24, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, has_colour) == 28, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, width) == 32, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, height) == 36, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, ring_frames) == 40, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, colour_registered) == 44, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, fx) == 48, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, fy) == 56, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, cx) == 64, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, cy) == 72, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, units_per_metre) == 80, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, distortion) == 88, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, readout_s) == 128, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, depth_offset_m) == 136, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, rotation) == 144, "the layout of CameraFrame");
static_assert(offsetof(tessera_CameraFrame, up) == 192, "the layout of CameraFrame");

#define TESSERA_CAMERA_FLOW "tessera.CameraFlow.v1"
// What the publisher is told on the service `camera_flow`. A live publisher need not read it.
typedef struct tessera_CameraFlow {
    // Rises whenever images are asked for again.
    uint64_t epoch;
    // In a new epoch a publisher with a ring goes on from here: the first image that is missing.
    uint64_t send_from;
    // A publisher with a ring sends images below this index alone.
    uint64_t send_below;
    // 1: nothing more is needed.
    uint64_t finished;
} tessera_CameraFlow;
static_assert(sizeof(tessera_CameraFlow) == 32, "the layout of CameraFlow");
static_assert(offsetof(tessera_CameraFlow, epoch) == 0, "the layout of CameraFlow");
static_assert(offsetof(tessera_CameraFlow, send_from) == 8, "the layout of CameraFlow");
static_assert(offsetof(tessera_CameraFlow, send_below) == 16, "the layout of CameraFlow");
static_assert(offsetof(tessera_CameraFlow, finished) == 24, "the layout of CameraFlow");

// When each step of a frame happened, nanoseconds of the monotonic clock; 0: not yet.
//
// For latency figures only: no result depends on them.
typedef struct tessera_StepTimes {
    // The sensor began to read or decode the frame.
    uint64_t read_began;
    // The frame was complete in shared memory.
    uint64_t frame_sent;
    // Reconstruction took it up.
    uint64_t surface_began;
    // The surface was complete in shared memory.
    uint64_t surface_sent;
    // Alignment took it up.
    uint64_t align_began;
    // The pose was published.
    uint64_t pose_sent;
} tessera_StepTimes;
static_assert(sizeof(tessera_StepTimes) == 48, "the layout of StepTimes");
static_assert(offsetof(tessera_StepTimes, read_began) == 0, "the layout of StepTimes");
static_assert(offsetof(tessera_StepTimes, frame_sent) == 8, "the layout of StepTimes");
static_assert(offsetof(tessera_StepTimes, surface_began) == 16, "the layout of StepTimes");
static_assert(offsetof(tessera_StepTimes, surface_sent) == 24, "the layout of StepTimes");
static_assert(offsetof(tessera_StepTimes, align_began) == 32, "the layout of StepTimes");
static_assert(offsetof(tessera_StepTimes, pose_sent) == 40, "the layout of StepTimes");

#define TESSERA_POSE_MESSAGE "tessera.Pose.v2"
// A pose with its uncertainty. A controller follows `odom_from_camera`, which never jumps;
// corrections change `world_from_odom`; `world_from_camera` is their product.
typedef struct tessera_PoseMessage {
    // Frame index as the source counts.
    uint64_t index;
    // Sensor time.
    int64_t stamp_nanos;
    // Position in [`POSE_STATES`].
    uint32_t state;
    // Correspondences behind the pose.
    uint32_t n_correspondences;
    // Why the state is not tracking: UTF-8, zero-padded.
    uint8_t reason[64];
    // Translation in metres, then quaternion `x y z w`.
    double odom_from_camera[7];
    // Translation in metres, then quaternion `x y z w`.
    double world_from_odom[7];
    // 6x6 row by row, translation first, metres and radians; all zero where unknown.
    double covariance[6][6];
    // Variance along and about each axis of the camera with its references fixed, m^2 and rad^2; all zero where
    // unknown. The motion since the pose before has the variances of both: what `covariance` adds is common to them.
    double step_variance[6];
    // When each step happened.
    tessera_StepTimes times;
} tessera_PoseMessage;
static_assert(sizeof(tessera_PoseMessage) == 584, "the layout of PoseMessage");
static_assert(offsetof(tessera_PoseMessage, index) == 0, "the layout of PoseMessage");
static_assert(offsetof(tessera_PoseMessage, stamp_nanos) == 8, "the layout of PoseMessage");
static_assert(offsetof(tessera_PoseMessage, state) == 16, "the layout of PoseMessage");
static_assert(offsetof(tessera_PoseMessage, n_correspondences) == 20, "the layout of PoseMessage");
static_assert(offsetof(tessera_PoseMessage, reason) == 24, "the layout of PoseMessage");
static_assert(offsetof(tessera_PoseMessage, odom_from_camera) == 88, "the layout of PoseMessage");
static_assert(offsetof(tessera_PoseMessage, world_from_odom) == 144, "the layout of PoseMessage");
static_assert(offsetof(tessera_PoseMessage, covariance) == 200, "the layout of PoseMessage");
static_assert(offsetof(tessera_PoseMessage, step_variance) == 488, "the layout of PoseMessage");
static_assert(offsetof(tessera_PoseMessage, times) == 536, "the layout of PoseMessage");

#endif
