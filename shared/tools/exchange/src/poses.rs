//! The trajectory as other benchmarks have it.

use std::io::{self, Write};
use tessera_geometry::Pose;

/// Writes rows of stamps and `world_from_camera`.
pub(crate) type PoseForm = fn(&[(i64, Pose)], &mut dyn Write) -> io::Result<()>;

/// KITTI: the first three rows of the matrix on one line, no times.
pub(crate) fn kitti(rows: &[(i64, Pose)], writer: &mut dyn Write) -> io::Result<()> {
    for (_, pose) in rows {
        let matrix = pose.to_homogeneous();
        let numbers: Vec<String> = (0..12).map(|k| format!("{:.9e}", matrix[(k / 4, k % 4)])).collect();
        writeln!(writer, "{}", numbers.join(" "))?;
    }
    Ok(())
}

/// EuRoC: nanoseconds, position, quaternion with w first.
pub(crate) fn euroc(rows: &[(i64, Pose)], writer: &mut dyn Write) -> io::Result<()> {
    writeln!(
        writer,
        "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []"
    )?;
    for (stamp_nanos, pose) in rows {
        let (t, q) = (&pose.translation.vector, pose.rotation.quaternion());
        writeln!(
            writer,
            "{stamp_nanos},{:.9},{:.9},{:.9},{:.9},{:.9},{:.9},{:.9}",
            t.x, t.y, t.z, q.w, q.i, q.j, q.k
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(form: PoseForm) -> String {
        let mut bytes = Vec::new();
        form(&[(1_305_031_102_175_304_000, Pose::translation(1.0, 2.0, -3.0))], &mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn rows_have_the_form_of_the_benchmarks() {
        let kitti = text(kitti);
        let numbers: Vec<f64> = kitti.split_whitespace().map(|word| word.parse().unwrap()).collect();
        assert_eq!(numbers, [1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.0, 1.0, -3.0]);
        let euroc = text(euroc);
        let row = euroc.lines().nth(1).unwrap();
        assert!(
            row.starts_with("1305031102175304000,1.000000000,2.000000000,-3.000000000,1.000000000,0."),
            "{row}"
        );
    }
}
