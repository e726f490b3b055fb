//! Arrays as they travel.

use crate::proto::{Array, IndexArray};

/// Where the shape is that of an array, -1 standing for any extent, the bytes; an absent array has no
/// rows.
fn checked<'a>(given: &[u32], data: &'a [u8], width: usize, shape: &[i64]) -> Result<&'a [u8], String> {
    if given.is_empty() && data.is_empty() && shape[0] <= 0 {
        return Ok(data);
    }
    let fits = given.len() == shape.len()
        && given.iter().zip(shape).all(|(&is, &wanted)| wanted < 0 || i64::from(is) == wanted);
    let count = given.iter().try_fold(width, |product, &extent| product.checked_mul(extent as usize));
    if fits && count == Some(data.len()) {
        return Ok(data);
    }
    Err(format!("an array of shape {given:?} and {} bytes came, not one of shape {shape:?}", data.len()))
}

pub fn numbers(array: Option<&Array>, shape: &[i64]) -> Result<Vec<f64>, String> {
    let (given, data) = array.map_or((&[][..], &[][..]), |a| (&a.shape, &a.data));
    let bytes = checked(given, data, 8, shape)?;
    Ok(bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap_or_default())).collect())
}

pub fn indices(array: Option<&IndexArray>, shape: &[i64]) -> Result<Vec<u32>, String> {
    let (given, data) = array.map_or((&[][..], &[][..]), |a| (&a.shape, &a.data));
    let bytes = checked(given, data, 4, shape)?;
    Ok(bytes.chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().unwrap_or_default())).collect())
}

pub fn to_wire(values: &[f64], shape: &[usize]) -> Array {
    Array {
        shape: shape.iter().map(|&extent| extent as u32).collect(),
        data: values.iter().flat_map(|value| value.to_le_bytes()).collect(),
    }
}
