//! Files of measured materials, right or wrong, for the tests.

/// A field: name, number of its element type, shape, and its bytes.
#[derive(Clone)]
pub struct Field {
    pub name: String,
    pub kind: u8,
    pub shape: Vec<u64>,
    pub bytes: Vec<u8>,
    /// Where the file says that it is, if not where it is.
    pub offset: Option<u64>,
}

/// A field of f32.
pub fn floats(name: &str, shape: &[u64], values: &[f32]) -> Field {
    let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    Field { name: name.into(), kind: 10, shape: shape.to_vec(), bytes, offset: None }
}

/// The fields of a small material: two elevations, all normals alike.
pub fn small() -> Vec<Field> {
    let flat = Field { name: "jacobian".into(), kind: 1, shape: vec![1], bytes: vec![1], offset: None };
    vec![
        floats("theta_i", &[2], &[0.2, 1.1]),
        floats("phi_i", &[1], &[0.0]),
        floats("ndf", &[2, 3], &[0.5; 6]),
        floats("sigma", &[2, 2], &[0.25; 4]),
        floats("vndf", &[1, 2, 2, 3], &[0.0, 1.0, 2.0, 0.0, 1.0, 1.0, 0.0, 3.0, 2.0, 0.0, 1.0, 1.0]),
        floats("luminance", &[1, 2, 2, 2], &[1.0, 2.0, 1.0, 1.0, 1.0, 0.5, 1.0, 1.0]),
        floats("rgb", &[1, 2, 3, 2, 2], &std::array::from_fn::<f32, 24, _>(|i| 0.01 * i as f32)),
        flat,
    ]
}

/// The file of these fields.
pub fn file(fields: &[Field]) -> Vec<u8> {
    let header: u64 = fields.iter().map(|f| 13 + f.name.len() as u64 + 8 * f.shape.len() as u64).sum();
    let mut out = b"tensor_file\0\x01\x00".to_vec();
    out.extend((fields.len() as u32).to_le_bytes());
    let mut offset = 18 + header;
    for field in fields {
        out.extend((field.name.len() as u16).to_le_bytes());
        out.extend(field.name.as_bytes());
        out.extend((field.shape.len() as u16).to_le_bytes());
        out.push(field.kind);
        out.extend(field.offset.unwrap_or(offset).to_le_bytes());
        out.extend(field.shape.iter().flat_map(|n| n.to_le_bytes()));
        offset += field.bytes.len() as u64;
    }
    fields.iter().for_each(|field| out.extend(&field.bytes));
    out
}
