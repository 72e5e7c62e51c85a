//! Numbers of single precision in records: four bytes each. They are rounded when a record is made, so that
//! what is in memory is what is read back.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub(super) fn serialize<S: Serializer>(numbers: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    let single: Vec<f32> = numbers.iter().map(|v| *v as f32).collect();
    single.serialize(serializer)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let single = Vec::<f32>::deserialize(deserializer)?;
    Ok(single.into_iter().map(f64::from).collect())
}

/// The seven numbers of a pose.
pub(super) mod pose {
    use super::{Deserialize, Deserializer, Serialize, Serializer};
    use tessera_geometry::PoseBits;

    pub(in crate::map) fn serialize<S: Serializer>(
        pose: &PoseBits,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let single = (pose.translation_m.map(|v| v as f32), pose.rotation_xyzw.map(|v| v as f32));
        single.serialize(serializer)
    }

    pub(in crate::map) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<PoseBits, D::Error> {
        let (translation, rotation) = <([f32; 3], [f32; 4])>::deserialize(deserializer)?;
        Ok(PoseBits { translation_m: translation.map(f64::from), rotation_xyzw: rotation.map(f64::from) })
    }
}
