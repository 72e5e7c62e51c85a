use super::*;

fn stated(name: &str, text: &str) -> StatedCamera {
    parse_stated(text, name).unwrap().unwrap_or_else(|| panic!("{name} is not known"))
}

fn refusal(name: &str, text: &str) -> String {
    parse_stated(text, name).unwrap_err()
}

const FOUR: [f64; 4] = [615.0, 616.0, 321.0, 244.0];

#[test]
fn open3d_and_other_json() {
    let text = r#"{"width": 640, "height": 480, "intrinsic_matrix": [615.0, 0, 0, 0, 616.0, 0, 321.0, 244.0, 1],
        "depth_scale": 4000.0, "fps": 15.0, "color_format": "RGB8"}"#;
    let found = stated("intrinsic.json", text);
    assert_eq!((found.size, found.intrinsics), (Some((640, 480)), FOUR));
    assert_eq!((found.units_per_metre, found.fps), (Some(4000.0), Some(15.0)));
    // Metres a unit, as a 32-bit float, and rows for columns.
    let text = r#"{"intrinsic_matrix": [[615, 0, 321], [0, 616, 244], [0, 0, 1]], "depth_scale": 0.0002500000118743628}"#;
    let found = stated("a.json", text);
    assert_eq!((found.size, found.intrinsics, found.units_per_metre), (None, FOUR, Some(4000.0)));
    let text =
        r#"{"camera": {"w": 1200, "h": 680, "fx": 615, "fy": 616, "cx": 321, "cy": 244, "scale": 6553.5}}"#;
    assert_eq!(stated("cam_params.json", text).units_per_metre, Some(6553.5));
    let text = r#"{"fl_x": 615, "fl_y": 616, "cx": 321.5, "cy": 244.5, "w": 640, "h": 480, "k1": 0.1, "frames": []}"#;
    let found = stated("transforms.json", text);
    assert_eq!((found.intrinsics, found.distortion[0]), (FOUR, 0.1));
    assert_eq!(parse_stated("{\"a\": 1}", "a.json"), Ok(None));
    assert_eq!(parse_stated("no json", "a.json"), Ok(None));
    // As pyrealsense2 prints them.
    let lens = |model: &str, coefficients: &str| {
        format!(
            r#"{{"fx": 615, "fy": 616, "ppx": 321, "ppy": 244, "model": "{model}", "coeffs": [{coefficients}]}}"#
        )
    };
    let found = stated("a.json", &lens("distortion.brown_conrady", "0.1, -0.2, 0, 0, 0.3"));
    assert_eq!((found.intrinsics, found.distortion), (FOUR, [0.1, -0.2, 0.0, 0.0, 0.3]));
    let found = stated("a.json", &lens("distortion.inverse_brown_conrady", "0, 0, 0, 0, 0"));
    assert_eq!((found.distortion, found.lens), ([0.0; 5], None));
    let four = "0.1, 0.2, 0.3, 0.4";
    let found = stated("a.json", &lens("equidistant", four)).lens;
    assert_eq!(found, Some(OtherLens::Equidistant([0.1, 0.2, 0.3, 0.4])));
    assert!(refusal("a.json", &lens("f_theta", four)).contains("distortion model 'f_theta'"));
    let text = r#"{"fx": 615, "fy": 616, "cx": 321, "cy": 244, "depth_scale": -3}"#;
    assert!(refusal("a.json", text).contains("depth scale is -3"));
}

#[test]
fn ros_orb_slam_and_kalibr() {
    let text = "image_width: 640\nimage_height: 480\ncamera_name: x\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [615., 0, 321,\n         0, 616, 244, 0, 0, 1]\n\
        distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.1, -0.2, 0, 0, 0.3]\n";
    let found = stated("camera.yaml", text);
    assert_eq!((found.size, found.intrinsics), (Some((640, 480)), FOUR));
    assert_eq!((found.distortion, found.units_per_metre), ([0.1, -0.2, 0.0, 0.0, 0.3], None));
    assert!(
        refusal("camera.yaml", &text.replace("plumb_bob", "equidistant")).contains("model 'equidistant'")
    );
    let fisheye = text
        .replace("plumb_bob", "equidistant")
        .replace("cols: 5", "cols: 4")
        .replace("0, 0, 0.3]", "0.01, 0.02]");
    let found = stated("camera.yaml", &fisheye);
    assert_eq!(found.lens, Some(OtherLens::Equidistant([0.1, -0.2, 0.01, 0.02])));
    assert_eq!(found.distortion, [0.0; 5]);
    let items =
        "camera_matrix:\n  data:\n  - 615\n  - 0\n  - 321\n  - 0\n  - 616\n  - 244\n  - 0\n  - 0\n  - 1\n";
    assert_eq!(stated("camera.yml", items).intrinsics, FOUR);
    let text = "%YAML:1.0\n---\nCamera.type: \"PinHole\"\nCamera.fx: 615.0\nCamera.fy: 616.0\nCamera.cx: 321.0\nCamera.cy: 244.0\n\
        Camera.k1: 0.1\nCamera.width: 640\nCamera.height: 480\nCamera.fps: 30\nDepthMapFactor: 5000.0 # units\n";
    let found = stated("tum1.yaml", text);
    assert_eq!((found.intrinsics, found.units_per_metre, found.fps), (FOUR, Some(5000.0), Some(30.0)));
    let fisheye = text.replace("PinHole", "KannalaBrandt8").replace("Camera.k1", "Camera.k4");
    assert_eq!(stated("tum1.yaml", &fisheye).lens, Some(OtherLens::Equidistant([0.0, 0.0, 0.0, 0.1])));
    let newer = text.replace("Camera.fx", "Camera1.fx").replace("DepthMapFactor", "RGBD.DepthMapFactor");
    assert_eq!(stated("tum1.yaml", &newer).units_per_metre, Some(5000.0));
    let text = "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.1, 0, 0, 0]\n  distortion_model: radtan\n  intrinsics: [615, 616, 321, 244]\n  resolution: [640, 480]\n";
    let found = stated("camchain.yaml", text);
    assert_eq!((found.intrinsics, found.size, found.distortion[0]), (FOUR, Some((640, 480)), 0.1));
    let fisheye = stated("camchain.yaml", &text.replace("radtan", "equidistant"));
    assert_eq!(fisheye.lens, Some(OtherLens::Equidistant([0.1, 0.0, 0.0, 0.0])));
    assert!(refusal("camchain.yaml", &text.replace("pinhole", "omni")).contains("camera model 'omni'"));
    assert_eq!(parse_stated("a: 1\n", "a.yaml"), Ok(None));
}

#[test]
fn plain_text() {
    let text = "# CAMERA_ID, MODEL\n1 PINHOLE 640 480 615 616 321.5 244.5\n";
    let found = stated("cameras.txt", text);
    assert_eq!((found.intrinsics, found.size), (FOUR, Some((640, 480))));
    let found = stated("cameras.txt", "1 OPENCV_FISHEYE 640 480 615 616 321.5 244.5 0.1 0.2 0.3 0.4\n");
    assert_eq!((found.intrinsics, found.lens), (FOUR, Some(OtherLens::Equidistant([0.1, 0.2, 0.3, 0.4]))));
    let full = stated("cameras.txt", "1 FULL_OPENCV 640 480 615 616 321.5 244.5 1 2 3 4 5 6 7 8\n");
    assert_eq!(full.lens, Some(OtherLens::Rational([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0])));
    assert!(refusal("cameras.txt", "1 FISHEYE 640 480 1 2 3\n").contains("camera model FISHEYE with 3"));
    assert!(
        refusal("cameras.txt", "1 PINHOLE 64 48 6 6 3 2\n2 PINHOLE 64 48 6 6 3 2\n").contains("2 cameras")
    );
    let text = "m_depthWidth = 640\nm_depthHeight = 480\nm_depthShift = 1000\nm_calibrationDepthIntrinsic = 615 0 321 0 0 616 244 0 0 0 1 0 0 0 0 1 \n";
    let found = stated("info.txt", text);
    assert_eq!((found.intrinsics, found.size, found.units_per_metre), (FOUR, Some((640, 480)), Some(1000.0)));
    for text in [
        "615 0 321\n0 616 244\n0 0 1\n",
        "615 0 321 0\n0 616 244 0\n0 0 1 0\n0 0 0 1\n",
        "615 616 321 244\n",
        "[[615, 0, 321], [0, 616, 244], [0, 0, 1]]",
    ] {
        let found = stated("camera-intrinsics.txt", text);
        assert_eq!((found.intrinsics, found.size), (FOUR, None), "{text}");
    }
    for text in ["1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", "words", "", "1 2 3"] {
        assert_eq!(parse_stated(text, "a.txt"), Ok(None), "{text}");
    }
    let word = refusal("a.txt", "615 0 nan\n0 616 244\n0 0 1\n");
    assert!(word.contains("cx is NaN"), "{word}");
}

#[test]
fn a_camera_is_scaled_about_the_edge_of_its_image() {
    let whole = StatedCamera {
        size: Some((640, 480)),
        intrinsics: [600.0, 600.0, 319.5, 239.5],
        ..StatedCamera::default()
    };
    let half = whole.scaled_to((320, 240)).unwrap();
    assert_eq!(half.intrinsics, [300.0, 300.0, 159.5, 119.5]);
    assert_eq!(whole.scaled_to((640, 360)), None);
}

#[test]
fn binning_and_region_of_a_camera_info() {
    let calibration = "image_width: 640\nimage_height: 480\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [615., 0, 321, 0, 616, 244, 0, 0, 1]\n";
    let binned = format!("{calibration}binning_x: 2\nbinning_y: 2\n");
    let found = stated("camera.yaml", &binned);
    assert_eq!((found.size, found.intrinsics), (Some((320, 240)), [307.5, 308.0, 160.25, 121.75]));
    let roi = "binning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 160\n  y_offset: 120\n  height: 240\n  width: 320\n  do_rectify: false\n";
    let found = stated("camera.yaml", &format!("{calibration}{roi}"));
    assert_eq!((found.size, found.intrinsics), (Some((320, 240)), [615.0, 616.0, 161.0, 124.0]));
    // As `ros2 topic echo --once` prints it, and `rostopic echo` of ROS 1.
    let list = |values: &[f64]| values.iter().map(|value| format!("- {value}\n")).collect::<String>();
    let k = [615.0, 0.0, 321.0, 0.0, 616.0, 244.0, 0.0, 0.0, 1.0];
    let head = "header:\n  stamp:\n    sec: 5\n    nanosec: 7\n  frame_id: depth\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\n";
    let echo = format!("{head}d:\n{}k:\n{}{roi}---\n", list(&[0.1, -0.2, 0.0, 0.0, 0.3]), list(&k));
    let found = stated("camera.yaml", &echo);
    assert_eq!((found.size, found.intrinsics), (Some((320, 240)), [615.0, 616.0, 161.0, 124.0]));
    assert_eq!(found.distortion, [0.1, -0.2, 0.0, 0.0, 0.3]);
    let echo = format!("{head}D: [0.0, 0.0, 0.0, 0.0, 0.0]\nK: {k:?}\nbinning_x: 0\nbinning_y: 0\n---\n");
    let found = stated("camera.yaml", &echo);
    assert_eq!((found.size, found.intrinsics), (Some((640, 480)), FOUR));
    let words = refusal("camera.yaml", &binned.replace("binning_x: 2", "binning_x: two"));
    assert!(words.contains("binning_x is 'two', expected a whole number"), "{words}");
}
