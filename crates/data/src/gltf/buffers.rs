//! A glTF document with its buffers, and accessors that are checked before they are read.

use super::super::{Error, error, source};
use super::text;
use ::gltf::accessor::{DataType, Dimensions, Item, Iter};
use ::gltf::json::Root;
use ::gltf::json::validation::{self, Checked, Validate};
use ::gltf::{Accessor, Document, buffer, image};
use base64::Engine;
use glam::Mat4;
use skinsplat_core::scene::SceneError;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// What integers of an accessor stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Integers {
    /// Themselves, or fractions of the largest value of their type where the accessor is normalised.
    AsSaid,
    /// Fractions in any case.
    Fractions,
}

/// A parsed document and the bytes that it refers to.
pub(in super::super) struct Source {
    pub(super) document: Document,
    buffers: Vec<Vec<u8>>,
    folder: PathBuf,
    /// The folder without links: of the document's name, and of the file behind it if that is a link. Buffers lie below one.
    roots: Vec<PathBuf>,
    /// Bytes of the document and its buffers.
    pub(super) size: usize,
    /// What has to be said of the document.
    pub(super) notes: Vec<String>,
    /// The extensions that it requires.
    pub(super) required: Vec<String>,
}

/// No encoded image of more bytes is read.
const MAX_IMAGE: usize = 1 << 28;

/// A URI as a message shows it.
fn shortened(uri: &str) -> String {
    uri.chars().take(80).collect()
}

impl Source {
    pub(super) fn open(path: &Path) -> Result<Self, Error> {
        let expected = "a glTF 2.0 document";
        let bytes = error::read_bytes(path, "glTF", expected)?;
        let invalid = |cause: ::gltf::Error| Error::invalid(path, "glTF", one_line(&cause), expected);
        let (json, blob) = text::split(&bytes).map_err(invalid)?;
        let named = |e: SceneError| Error::scene(path, e);
        let mut root = text::parse(&json).map_err(named)?;
        let (required, notes) = text::check_extensions(&mut root).map_err(named)?;
        check_root(&root).map_err(named)?;
        let document = validated(root).map_err(invalid)?;
        let folder = folder_of(path);
        let size = bytes.len();
        let roots = [folder.canonicalize(), path.canonicalize().map(|path| folder_of(&path))];
        let roots = roots.into_iter().flatten().collect();
        let mut source = Self { document, buffers: Vec::new(), folder, roots, size, notes, required };
        source.buffers = source.load_buffers(blob).map_err(named)?;
        source.size += source.buffers.iter().map(Vec::len).sum::<usize>();
        Ok(source)
    }

    fn load_buffers(&self, mut blob: Option<Vec<u8>>) -> Result<Vec<Vec<u8>>, SceneError> {
        let load = |buffer: buffer::Buffer| {
            let field = format!("buffers[{}]", buffer.index());
            let bytes = match buffer.source() {
                buffer::Source::Bin => blob
                    .take()
                    .ok_or_else(|| SceneError::new(&field, "no binary chunk", "a .glb with its BIN chunk"))?,
                buffer::Source::Uri(uri) => self.resolve(uri, &field, buffer.length())?,
            };
            if bytes.len() < buffer.length() {
                let problem = format!("truncated, {} bytes", bytes.len());
                return Err(SceneError::new(field, problem, format!("byteLength {}", buffer.length())));
            }
            Ok(bytes)
        };
        self.document.buffers().map(load).collect()
    }

    /// The first `limit` bytes behind a `data:` URI or a path to a regular file below the document's folder, whichever links
    /// there are on the way.
    fn resolve(&self, uri: &str, field: &str, limit: usize) -> Result<Vec<u8>, SceneError> {
        let broken = |problem: String| {
            let expected = "a path to a file in the document's folder, or a base64 data URI";
            SceneError::new(format!("{field}.uri"), problem, expected)
        };
        if let Some(data) = uri.strip_prefix("data:") {
            let (_, text) =
                data.split_once(";base64,").ok_or_else(|| broken("data that is not base64".into()))?;
            return base64::engine::general_purpose::STANDARD.decode(text).map_err(|e| broken(e.to_string()));
        }
        if uri.contains(':') {
            return Err(broken(format!("{:?}", shortened(uri))));
        }
        let relative = urlencoding::decode(uri).map_err(|e| broken(e.to_string()))?;
        let relative = Path::new(relative.as_ref());
        let inside = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
        let leads_out = || broken(format!("{:?} leads out of the folder", shortened(uri)));
        if !relative.components().all(inside) {
            return Err(leads_out());
        }
        let path = self.folder.join(relative);
        let read = || {
            let file = source::open(&path)?;
            let mut bytes = Vec::new();
            file.take(limit as u64).read_to_end(&mut bytes)?;
            Ok(bytes)
        };
        let unreadable = |e: io::Error| broken(format!("{}: {e}", path.display()));
        let bytes = read().map_err(unreadable)?;
        let target = path.canonicalize().map_err(unreadable)?;
        if self.roots.iter().any(|root| target.starts_with(root)) { Ok(bytes) } else { Err(leads_out()) }
    }

    /// The object of KHR_gaussian_splatting of a primitive.
    pub(super) fn splat_extension(&self, primitive: &::gltf::Primitive<'_>) -> Option<serde_json::Value> {
        let extras = primitive.extras().as_ref()?;
        let mut extras: serde_json::Value = serde_json::from_str(extras.get()).ok()?;
        extras.get_mut("KHR_gaussian_splatting").map(serde_json::Value::take)
    }

    /// The encoded bytes of an image.
    pub(super) fn image_bytes(&self, image: &image::Image) -> Result<Vec<u8>, SceneError> {
        // Not through `image.source()`, which panics on a view without a MIME type.
        let field = format!("images[{}]", image.index());
        let json = &self.document.as_json().images[image.index()];
        match (&json.buffer_view, &json.uri) {
            (Some(index), _) => match self.document.views().nth(index.value()) {
                Some(view) => self.view(&view, &field).map(<[u8]>::to_vec),
                None => Err(SceneError::new(field, "no such buffer view", "a buffer view or a URI")),
            },
            (None, Some(uri)) => self.resolve(uri, &field, MAX_IMAGE),
            (None, None) => Err(SceneError::new(field, "no source", "a buffer view or a URI")),
        }
    }

    /// The parent of each node.
    pub(super) fn parents(&self) -> Result<Vec<Option<usize>>, SceneError> {
        let mut parents = vec![None; self.document.nodes().count()];
        for node in self.document.nodes() {
            for child in node.children() {
                if let Some(other) = parents[child.index()].replace(node.index()) {
                    let problem = format!("parents {other} and {}", node.index());
                    return Err(SceneError::new(
                        format!("nodes[{}]", child.index()),
                        problem,
                        "at most one parent",
                    ));
                }
            }
        }
        // A cycle among ancestors would never end the walk to the root.
        let mut ends = vec![false; parents.len()];
        for start in 0..parents.len() {
            let mut path = Vec::new();
            let mut next = Some(start);
            while let Some(node) = next.filter(|&node| !ends[node]) {
                if path.len() == parents.len() {
                    return Err(SceneError::new(format!("nodes[{start}]"), "a cycle", "a forest of nodes"));
                }
                path.push(node);
                next = parents[node];
            }
            path.into_iter().for_each(|node| ends[node] = true);
        }
        Ok(parents)
    }

    /// The items of an accessor, whose element type must be `T`'s.
    pub(super) fn items<T: Item>(
        &self,
        accessor: &Accessor,
        kind: (DataType, Dimensions),
        field: &str,
    ) -> Result<Vec<T>, SceneError> {
        if (accessor.data_type(), accessor.dimensions()) != kind {
            let problem = format!("{:?} of {:?}", accessor.dimensions(), accessor.data_type());
            return Err(SceneError::new(field, problem, format!("{:?} of {:?}", kind.1, kind.0)));
        }
        self.check_extents(accessor, field)?;
        if accessor.view().is_none() && accessor.sparse().is_none() {
            return Ok((0..accessor.count()).map(|_| T::zero()).collect());
        }
        let data = |buffer: buffer::Buffer| self.buffers.get(buffer.index()).map(Vec::as_slice);
        Iter::new(accessor.clone(), data)
            .map(Iterator::collect)
            .ok_or_else(|| SceneError::new(field, "no data", "an accessor with a buffer view"))
    }

    /// Vectors of floats or of integers, which stand for themselves or for fractions.
    pub(super) fn vectors<const N: usize>(
        &self,
        accessor: &Accessor,
        dimensions: Dimensions,
        integers: Integers,
        field: &str,
    ) -> Result<Vec<[f64; N]>, SceneError>
    where
        [i8; N]: Item,
        [u8; N]: Item,
        [i16; N]: Item,
        [u16; N]: Item,
        [f32; N]: Item,
    {
        let fractions = integers == Integers::Fractions || accessor.normalized();
        let unit = |one: f64| if fractions { one } else { 1.0 };
        fn over<T: Copy + Into<f64>, const N: usize>(rows: &[[T; N]], one: f64) -> Vec<[f64; N]> {
            // -128 and -32768 stand for -1 too. A number that is none stays none.
            let value = |v: T| if one == 1.0 { v.into() } else { (v.into() / one).max(-1.0) };
            rows.iter().map(|row| row.map(value)).collect()
        }
        let kind = accessor.data_type();
        Ok(match kind {
            DataType::I8 => over(&self.items::<[i8; N]>(accessor, (kind, dimensions), field)?, unit(127.0)),
            DataType::U8 => over(&self.items::<[u8; N]>(accessor, (kind, dimensions), field)?, unit(255.0)),
            DataType::I16 => {
                over(&self.items::<[i16; N]>(accessor, (kind, dimensions), field)?, unit(32767.0))
            }
            DataType::U16 => {
                over(&self.items::<[u16; N]>(accessor, (kind, dimensions), field)?, unit(65535.0))
            }
            _ => over(&self.items::<[f32; N]>(accessor, (DataType::F32, dimensions), field)?, 1.0),
        })
    }

    /// A list of 4x4 matrices.
    pub(super) fn matrices(&self, accessor: &Accessor, field: &str) -> Result<Vec<Mat4>, SceneError> {
        let columns: Vec<[[f32; 4]; 4]> = self.items(accessor, (DataType::F32, Dimensions::Mat4), field)?;
        Ok(columns.iter().map(Mat4::from_cols_array_2d).collect())
    }

    fn check_extents(&self, accessor: &Accessor, field: &str) -> Result<(), SceneError> {
        match accessor.view() {
            Some(view) => {
                self.check_extent(&view, accessor.offset(), accessor.count(), accessor.size(), field)?
            }
            None => self.check_zeros(accessor, field)?,
        }
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let index_size = indices.index_type().size();
            self.check_extent(&indices.view(), indices.offset(), sparse.count(), index_size, field)?;
            self.check_extent(&values.view(), values.offset(), sparse.count(), accessor.size(), field)?;
        }
        Ok(())
    }

    /// An accessor without a buffer view is all zeros (glTF 2.0, 3.6.2.1), of which nothing in the file bounds the number.
    fn check_zeros(&self, accessor: &Accessor, field: &str) -> Result<(), SceneError> {
        let bytes = accessor.count().checked_mul(accessor.size());
        if accessor.count() > 0 && bytes.is_some_and(|bytes| bytes <= self.size) {
            return Ok(());
        }
        let problem = format!("{} items without a buffer view", accessor.count());
        let expected = format!("at least one, and no more bytes of zeros than the file has ({})", self.size);
        Err(SceneError::new(field, problem, expected))
    }

    /// `count` items of `size` bytes must lie within the view, and the view within its buffer.
    fn check_extent(
        &self,
        view: &buffer::View,
        offset: usize,
        count: usize,
        size: usize,
        field: &str,
    ) -> Result<(), SceneError> {
        let bytes = self.view(view, field)?.len();
        let stride = view.stride().unwrap_or(size);
        let last = count.checked_sub(1).and_then(|n| n.checked_mul(stride));
        let end = last.and_then(|last| last.checked_add(offset)?.checked_add(size));
        if stride >= size && end.is_some_and(|end| end <= bytes) {
            return Ok(());
        }
        let problem =
            format!("{count} items, {stride} bytes apart from {offset}, in a view of {bytes} bytes");
        Err(SceneError::new(field, problem, "at least one item, and all of them inside the view"))
    }

    fn view(&self, view: &buffer::View, field: &str) -> Result<&[u8], SceneError> {
        let end = view.offset().checked_add(view.length());
        let bytes = self.buffers.get(view.buffer().index());
        bytes.zip(end).and_then(|(bytes, end)| bytes.get(view.offset()..end)).ok_or_else(|| {
            let problem = format!("bufferViews[{}] ends outside its buffer", view.index());
            SceneError::new(field, problem, "a view inside its buffer")
        })
    }
}

/// The folder that a path lies in, by a name that the system knows.
fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// The document, if it is what the crate takes for valid; accessors without a buffer view, which it refuses, are zeros.
fn validated(root: Root) -> Result<Document, ::gltf::Error> {
    let mut faults = Vec::new();
    root.validate(&root, ::gltf::json::Path::new, &mut |path, fault| {
        let path = path();
        let without_view = |path: &str| path.starts_with("accessors[") && path.ends_with("].bufferView");
        if fault != validation::Error::Missing || !without_view(path.as_str()) {
            faults.push((path, fault));
        }
    });
    if faults.is_empty() {
        Ok(Document::from_json_without_validation(root))
    } else {
        Err(::gltf::Error::Validation(faults))
    }
}

/// What the crate's own validation takes for granted.
fn check_root(root: &Root) -> Result<(), SceneError> {
    if !root.asset.version.starts_with("2.") {
        return Err(SceneError::new("asset.version", &root.asset.version, "2.x"));
    }
    for (m, mesh) in root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            if let Some(index) = primitive.attributes.values().find(|i| i.value() >= root.accessors.len()) {
                let field = format!("meshes[{m}].primitives[{p}].attributes");
                let expected = format!("an index below {} (accessors)", root.accessors.len());
                return Err(SceneError::new(field, format!("accessor {}", index.value()), expected));
            }
        }
    }
    for (a, animation) in root.animations.iter().enumerate() {
        for (c, channel) in animation.channels.iter().enumerate() {
            let field = format!("animations[{a}].channels[{c}].target");
            let node = channel.target.node.value();
            if node >= root.nodes.len() {
                let expected = format!("an index below {} (nodes)", root.nodes.len());
                return Err(SceneError::new(field, format!("node {node}"), expected));
            }
            if channel.target.path == Checked::Invalid {
                return Err(SceneError::new(
                    field,
                    "unknown path",
                    "translation, rotation, scale or weights",
                ));
            }
        }
    }
    Ok(())
}

/// A validation error lists every fault; the first one is enough.
fn one_line(error: &::gltf::Error) -> String {
    match error {
        ::gltf::Error::Validation(faults) if !faults.is_empty() => {
            format!("{}: {}", faults[0].0, faults[0].1)
        }
        other => other.to_string(),
    }
}
