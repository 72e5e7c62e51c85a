//! Depth images of one's own, as `Vec<u16>`: where was the camera?
//!
//! `cargo run --release -p tessera-offline --example own_frames`
#![forbid(unsafe_code)]

use tessera_offline::{Camera, Method, RawFrame, Run, SettingError};

fn main() -> Result<(), SettingError> {
    let camera = Camera::pinhole((320, 240), [262.5, 262.5, 159.5, 119.5], 1000.0);
    let mut run = Run::new(&camera, &Method::default())?;
    for k in 0..10_i64 {
        // A corner of a room, millimetres, that the camera approaches by 10 mm a frame.
        let wall = |pixel: i64| {
            let (column, row) = (pixel % 320 - 160, pixel / 320 - 120);
            2500 - 10 * k - 2 * column.abs() - row.abs()
        };
        let depth: Vec<u16> = (0..320 * 240).map(|pixel| wall(pixel) as u16).collect();
        let frame = RawFrame { stamp_nanos: k * 33_333_333, rotation: None, up: None, depth, colour: None };
        let tracked = run.push(&frame);
        println!("{:?} {:?}", tracked.state, tracked.world_from_camera.translation.vector);
    }
    Ok(())
}
