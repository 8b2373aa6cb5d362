//! The edits that change points or sharpness, by the path that leads to them.

use crate::ids::FaceId;
use crate::mesh::Edit;
use rustc_hash::FxHashMap;

/// A face of some level on the way to an edit, that face included.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct TrieId(u32);

/// Paths of edits, level 0 left out: it is part of the control mesh.
#[derive(Debug, Default)]
pub(super) struct EditTrie {
    roots: FxHashMap<FaceId, TrieId>,
    nodes: Vec<Node>,
}

#[derive(Debug, Default)]
struct Node {
    /// Child number and node.
    children: Vec<(u32, TrieId)>,
    /// Edits of this face's vertices and edges, as indices into the mesh's list.
    edits: Vec<u32>,
}

impl EditTrie {
    pub fn new(edits: &[Edit]) -> Self {
        let mut trie = Self::default();
        for (i, edit) in edits.iter().enumerate() {
            if edit.is_refined() {
                trie.insert(i as u32, edit);
            }
        }
        trie
    }

    fn insert(&mut self, i: u32, edit: &Edit) {
        let root = self.root(edit.face()).unwrap_or_else(|| {
            let root = self.push();
            self.roots.insert(edit.face(), root);
            root
        });
        let last = edit.children().iter().fold(root, |node, &k| {
            self.child(node, k).unwrap_or_else(|| {
                let child = self.push();
                self.nodes[node.0 as usize].children.push((k, child));
                child
            })
        });
        self.nodes[last.0 as usize].edits.push(i);
    }

    fn push(&mut self) -> TrieId {
        self.nodes.push(Node::default());
        TrieId(self.nodes.len() as u32 - 1)
    }

    /// Base faces that edits lie in.
    pub fn faces(&self) -> impl Iterator<Item = FaceId> {
        self.roots.keys().copied()
    }

    pub fn root(&self, face: FaceId) -> Option<TrieId> {
        self.roots.get(&face).copied()
    }

    pub fn child(&self, node: TrieId, k: u32) -> Option<TrieId> {
        self.nodes[node.0 as usize].children.iter().find(|c| c.0 == k).map(|c| c.1)
    }

    /// Edits that are applied when the face has been computed.
    pub fn edits(&self, node: TrieId) -> &[u32] {
        &self.nodes[node.0 as usize].edits
    }

    /// Whether deeper edits follow.
    pub fn is_pending(&self, node: TrieId) -> bool {
        !self.nodes[node.0 as usize].children.is_empty()
    }
}
