//! `.npy` and `.npz`.

use crate::files::{self, Values};
use skinsplat_data::{npy, npz::Archive};

fn npy_file(folder: &std::path::Path, header: &str, data: &[u8]) -> std::path::PathBuf {
    let path = folder.join("array.npy");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn header(descr: &str, fortran: bool, shape: &str) -> String {
    let fortran = if fortran { "True" } else { "False" };
    format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n")
}

#[test]
fn half_floats_are_read_in_both_byte_orders() {
    let folder = tempfile::tempdir().unwrap();
    for (descr, bytes) in [("<f2", [0x00, 0x3c, 0x00, 0xc1]), (">f2", [0x3c, 0x00, 0xc1, 0x00])] {
        let array = npy::read(&npy_file(folder.path(), &header(descr, false, "(2,)"), &bytes)).unwrap();
        assert_eq!(array.values, [1.0, -2.5], "{descr}");
    }
}

#[test]
fn every_number_type_is_read_in_both_byte_orders() {
    let folder = tempfile::tempdir().unwrap();
    macro_rules! check {
        ($kind:literal, $t:ty) => {{
            let values: [$t; 3] = [0 as $t, 1 as $t, <$t>::MAX];
            let little: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            let big: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
            for (order, bytes) in [("<", little), (">", big)] {
                let descr = format!("{order}{}", $kind);
                let array =
                    npy::read(&npy_file(folder.path(), &header(&descr, false, "(3,)"), &bytes)).unwrap();
                assert_eq!(
                    (array.shape, array.values),
                    (vec![3], values.map(|v| v as f64).to_vec()),
                    "{descr}"
                );
            }
        }};
    }
    check!("f4", f32);
    check!("f8", f64);
    check!("i1", i8);
    check!("i2", i16);
    check!("i4", i32);
    check!("i8", i64);
    check!("u1", u8);
    check!("u2", u16);
    check!("u4", u32);
    check!("u8", u64);
    let array = npy::read(&npy_file(folder.path(), &header("|b1", false, "(2, 1)"), &[1, 0])).unwrap();
    assert_eq!((array.shape, array.values), (vec![2, 1], vec![1.0, 0.0]));
    let array = npy::read(&npy_file(folder.path(), &header("|u1", false, "()"), &[7])).unwrap();
    assert_eq!((array.shape, array.values), (vec![], vec![7.0]));
}

#[test]
fn fortran_order_becomes_c_order() {
    let folder = tempfile::tempdir().unwrap();
    // a[i][j][k] = 100 i + 10 j + k of shape (2, 3, 4), the first index running fastest.
    let value = |i: u8, j: u8, k: u8| 100 * i + 10 * j + k;
    let stored: Vec<u8> =
        (0..4).flat_map(|k| (0..3).flat_map(move |j| (0..2).map(move |i| value(i, j, k)))).collect();
    let expected: Vec<f64> = (0..2)
        .flat_map(|i| (0..3).flat_map(move |j| (0..4).map(move |k| f64::from(value(i, j, k)))))
        .collect();
    let array = npy::read(&npy_file(folder.path(), &header("|u1", true, "(2, 3, 4)"), &stored)).unwrap();
    assert_eq!(array.values, expected);
}

#[test]
fn broken_headers_and_absurd_shapes_are_refused_before_anything_is_allocated() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        (header("<f4", false, "(4294967295, 4294967295, 4294967295)"), "at most"),
        (header("<f4", false, "(1000000000,)"), "at most"),
        (header("<f4", false, "(100000000,)"), "truncated"),
        (header("<f4", false, "(3,)"), "truncated"),
        (header("<f4", false, "(-3,)"), "header"),
        (header("<f4", false, "3"), "header"),
        (header("<f16", false, "(1,)"), "32 or 64 bit"),
        (header("<c8", false, "(1,)"), "32 or 64 bit"),
        (header("|O", false, "(1,)"), "pickled"),
        ("{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (1,), }".into(), "header"),
        ("(".repeat(60_000), "header"),
        (String::new(), "header"),
    ];
    for (text, expected) in cases {
        let path = npy_file(folder.path(), &text, &[0; 8]);
        let error = npy::read(&path).unwrap_err().to_string();
        assert!(error.contains(expected), "{expected:?} not in {error:.300}");
        assert!(error.starts_with(&path.display().to_string()));
    }
}

#[test]
fn what_is_written_is_what_numpy_and_npyz_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.npy");
    let values = [1.5f32, -0.0, f32::MIN_POSITIVE, f32::MAX, 3.0, 4.0];
    npy::write_f32(&path, &[1, 2, 3], values).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(bytes.len() % 64, values.len() * 4, "the header fills whole lines of 64 bytes");
    let file = npyz::NpyFile::new(&bytes[..]).unwrap();
    assert_eq!((file.shape(), file.order()), (&[1u64, 2, 3][..], npyz::Order::C));
    assert_eq!(file.into_vec::<f32>().unwrap().map_bits(), values.to_vec().map_bits());
}

trait Bits {
    fn map_bits(&self) -> Vec<u32>;
}

impl Bits for Vec<f32> {
    fn map_bits(&self) -> Vec<u32> {
        self.iter().map(|v| v.to_bits()).collect()
    }
}

#[test]
fn archives_check_shapes_against_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arrays.npz");
    files::npz(
        &path,
        &[
            ("a", &[2, 3], Values::F32(vec![0.0; 6])),
            ("b", &[2, 4], Values::F32(vec![0.0; 8])),
            ("c", &[3], Values::F64(vec![0.0, f64::NAN, 0.0])),
        ],
    );
    let mut archive = Archive::open(&path, "test").unwrap();
    assert_eq!(archive.names(), ["a", "b", "c"]);
    assert_eq!(archive.header("b").unwrap().shape, [2, 4]);
    archive.require("a", "N,3").unwrap();
    archive.require("b", "N,*").unwrap();
    let error = archive.require("b", "N,3").unwrap_err().to_string();
    assert!(error.ends_with("b: shape [2, 4]; expected (N,3) with N = 2"), "{error}");
    assert_eq!(archive.require("c", "3").unwrap_err().field(), "c[1]");
    let error = archive.require("d", "3").unwrap_err().to_string();
    assert!(error.contains("d: missing; the file holds a, b, c"), "{error}");
    assert!(archive.optional("d", "3").unwrap().is_none());
}
