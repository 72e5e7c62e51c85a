//! Points as `sensor_msgs/msg/PointCloud2`.

use tessera_occupancy::ColouredPoint;
use tessera_recording::ros::{Header, PointCloud};

/// Points as a message has them: x, y, z, and `rgb` packed as 0x00RRGGBB where any has a colour.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Packed {
    has_colour: bool,
    data: Vec<u8>,
}

impl Packed {
    /// Packs points of the frame that the message will name.
    pub(crate) fn new(points: &[ColouredPoint]) -> Self {
        let has_colour = points.iter().any(|point| point.rgb != [0; 3]);
        let mut data = Vec::with_capacity(points.len() * if has_colour { 16 } else { 12 });
        for ColouredPoint { position, rgb: [red, green, blue] } in points {
            position.iter().for_each(|metres| data.extend(metres.to_le_bytes()));
            if has_colour {
                data.extend([*blue, *green, *red, 0]);
            }
        }
        Self { has_colour, data }
    }

    /// Bytes of the points.
    pub(crate) fn len(&self) -> usize {
        self.data.len()
    }

    /// The message, in one row.
    pub(crate) fn message<'a>(&'a self, header: Header<'a>) -> PointCloud<'a> {
        let names = if self.has_colour { &["x", "y", "z", "rgb"][..] } else { &["x", "y", "z"] };
        PointCloud::in_a_row(header, names, &self.data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_recording::ros::Time;

    #[test]
    fn colour_is_packed_where_there_is_any() {
        let header = || Header { stamp: Time::from_nanos(1), frame_id: "map".into() };
        let mut points = [ColouredPoint { position: [1.0, 2.0, 3.0], rgb: [0; 3] }; 2];
        let plain = Packed::new(&points);
        let message = plain.message(header());
        assert_eq!(
            (message.width, message.point_step, message.row_step, message.fields.len()),
            (2, 12, 24, 3)
        );
        points[1].rgb = [0x11, 0x22, 0x33];
        let coloured = Packed::new(&points);
        let message = coloured.message(header());
        assert_eq!((message.point_step, message.fields[3].offset, message.data.len()), (16, 12, 32));
        let rgb = f32::from_le_bytes(message.data[28..32].try_into().unwrap());
        assert_eq!(rgb.to_bits(), 0x0011_2233);
    }
}
