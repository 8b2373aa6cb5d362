//! Places on a surface to be evaluated: CSV with `face,sub,u,v` in its first columns.

use crate::error::{Error, Result};
use crate::ids::FaceId;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Longest line in bytes, and one more: without a bound a device file would fill the memory.
const MAX_LINE: u64 = 1 << 16;

/// What some programs begin a text in UTF-8 with.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// A place on a mesh's limit surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplePlace {
    /// The line it comes from, counted from 1.
    pub line: usize,
    /// The face, in file order.
    pub face: FaceId,
    /// Which of its quads: 0 for a quad, the corner's number for other faces.
    pub sub: u32,
    /// Parameters within that quad, 0..=1.
    pub u: f64,
    /// See `u`.
    pub v: f64,
}

/// Reads places; comment lines (`#`), one header line and further columns are passed over.
pub fn read_sample_places(path: &Path) -> Result<Vec<SamplePlace>> {
    let file = File::open(path).map_err(|e| Error::io("read", path, e))?;
    parse_sample_places(BufReader::new(file), path)
}

fn parse_sample_places(mut reader: impl BufRead, path: &Path) -> Result<Vec<SamplePlace>> {
    let (mut places, mut line) = (Vec::new(), Vec::new());
    for number in 1.. {
        line.clear();
        let n_read =
            reader.by_ref().take(MAX_LINE).read_until(b'\n', &mut line).map_err(|e| Error::io("read", path, e))?;
        if n_read == 0 {
            break;
        }
        let text = if number == 1 { line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&line) } else { &line };
        let place = parse_line(text, number, places.is_empty());
        places.extend(place.map_err(|message| Error::input(message).at(path, Some(number)))?);
    }
    Ok(places)
}

/// The place of a line, if it is not one to be passed over.
fn parse_line(line: &[u8], number: usize, may_be_header: bool) -> Result<Option<SamplePlace>, String> {
    if line.len() as u64 == MAX_LINE {
        return Err(format!("a line of {MAX_LINE} bytes and more; is this a table of face,sub,u,v?"));
    }
    let row = std::str::from_utf8(line).map_err(|_| "this is no text in UTF-8".to_owned())?.trim();
    let is_header = may_be_header && row.starts_with("face,sub,u,v");
    if row.is_empty() || row.starts_with('#') || is_header { Ok(None) } else { parse_row(row, number).map(Some) }
}

fn parse_row(row: &str, line: usize) -> Result<SamplePlace, String> {
    let mut columns = row.split(',').map(str::trim);
    let mut column = |name: &str| columns.next().ok_or_else(|| format!("column {name} of face,sub,u,v is missing"));
    let id = |text: &str| text.parse::<u32>().map_err(|_| format!("'{text}' is no number of a face or quad"));
    let parameter = |text: &str| {
        let value = text.parse::<f64>().ok().filter(|t| (0.0..=1.0).contains(t));
        value.ok_or_else(|| format!("parameter '{text}' should lie within 0..1"))
    };
    Ok(SamplePlace {
        line,
        face: FaceId(id(column("face")?)?),
        sub: id(column("sub")?)?,
        u: parameter(column("u")?)?,
        v: parameter(column("v")?)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Vec<SamplePlace>> {
        parse_sample_places(text.as_bytes(), Path::new("s.csv"))
    }

    #[test]
    fn comments_header_and_further_columns_are_passed_over() {
        let places = parse("\u{feff}# limit points\nface,sub,u,v,px\n0,0,0.25,1,7\r\n\n 3, 2, 0, 0.5\n").unwrap();
        let place = |line, face, sub, u, v| SamplePlace { line, face: FaceId(face), sub, u, v };
        assert_eq!(places, [place(3, 0, 0, 0.25, 1.0), place(5, 3, 2, 0.0, 0.5)]);
    }

    #[test]
    fn every_mistake_gets_a_sentence_with_its_line() {
        let cases = [
            ("0,0,0\n", "s.csv:1: column v of face,sub,u,v is missing"),
            ("0,0,0,0\nx,0,0,0\n", "s.csv:2: 'x' is no number of a face or quad"),
            ("0,-1,0,0\n", "s.csv:1: '-1' is no number"),
            ("0,0,1.5,0\n", "s.csv:1: parameter '1.5' should lie within 0..1"),
            ("0,0,nan,0\n", "s.csv:1: parameter 'nan' should"),
        ];
        for (text, expected) in cases {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.starts_with(expected), "{text:?}: {message}");
        }
        for (text, expected) in [
            (&b"0,0,0,0\n0,0,\xff,0\n"[..], "s.csv:2: this is no text in UTF-8"),
            (&[b'1'; 1 << 17][..], "s.csv:1: a line of 65536 bytes and more"),
        ] {
            let message = parse_sample_places(text, Path::new("s.csv")).unwrap_err().to_string();
            assert!(message.starts_with(expected), "{message}");
        }
    }
}
