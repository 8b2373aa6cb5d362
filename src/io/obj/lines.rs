//! Logical lines of a text file: numbered, and joined where a backslash continues them.

use std::io::{self, BufRead, Read};

/// Longest logical line in bytes. No mesh comes near it; without a bound a device file would fill the memory.
pub(super) const MAX_LINE: usize = 1 << 28;

/// One statement.
#[derive(Debug, PartialEq)]
pub struct Line<'a> {
    /// Number of its first physical line, from 1.
    pub number: usize,
    /// Its bytes without the end of line; continuations joined by a space.
    pub text: &'a [u8],
}

/// Reads logical lines into one buffer that is used again and again.
pub struct LogicalLines<R> {
    reader: R,
    buffer: Vec<u8>,
    n_read: usize,
}

impl<R: BufRead> LogicalLines<R> {
    /// Starts at line 1.
    pub fn new(reader: R) -> Self {
        Self::starting_at(1, reader)
    }

    /// Starts at a line whose number is known.
    pub fn starting_at(number: usize, reader: R) -> Self {
        Self { reader, buffer: Vec::new(), n_read: number - 1 }
    }

    /// The next line, or `None` at the end of the file.
    pub fn next_line(&mut self) -> io::Result<Option<Line<'_>>> {
        self.buffer.clear();
        let number = self.n_read + 1;
        if !self.append_physical_line()? {
            return Ok(None);
        }
        // What looks like one in a comment is the end of a path on Windows.
        while self.buffer.last() == Some(&b'\\') && !is_comment(&self.buffer) {
            *self.buffer.last_mut().expect("not empty") = b' ';
            self.append_physical_line()?;
        }
        let text = match self.buffer.strip_prefix(b"\xef\xbb\xbf") {
            Some(text) if number == 1 => text,
            _ => &self.buffer,
        };
        Ok(Some(Line { number, text }))
    }

    /// False at the end of the file.
    fn append_physical_line(&mut self) -> io::Result<bool> {
        let room = MAX_LINE.saturating_sub(self.buffer.len()) as u64;
        let n = self.reader.by_ref().take(room).read_until(b'\n', &mut self.buffer)?;
        if self.buffer.len() >= MAX_LINE {
            let message = format!("line {} is longer than {MAX_LINE} bytes; is this an OBJ file?", self.n_read + 1);
            return Err(io::Error::new(io::ErrorKind::InvalidData, message));
        }
        self.n_read += 1;
        self.buffer.truncate(length_without_end(&self.buffer));
        Ok(n > 0)
    }
}

fn is_comment(line: &[u8]) -> bool {
    line.trim_ascii_start().first() == Some(&b'#')
}

/// Length of a line without its final `\n` or `\r\n`.
fn length_without_end(line: &[u8]) -> usize {
    let line = line.strip_suffix(b"\n").unwrap_or(line);
    line.strip_suffix(b"\r").unwrap_or(line).len()
}

/// The words of a line: what blanks and tabs separate.
pub fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines_of(text: &[u8]) -> Vec<(usize, String)> {
        let mut lines = LogicalLines::new(text);
        let mut all = Vec::new();
        while let Some(line) = lines.next_line().unwrap() {
            all.push((line.number, String::from_utf8_lossy(line.text).into_owned()));
        }
        all
    }

    #[test]
    fn continued_lines_are_one_with_the_first_number() {
        let text = b"a\\\n b \\\r\nc\r\nd\n\ne\\";
        let expected = [(1, "a  b  c"), (4, "d"), (5, ""), (6, "e ")].map(|(n, s)| (n, s.to_owned()));
        assert_eq!(lines_of(text), expected);
    }

    #[test]
    fn comments_are_not_continued() {
        let expected = [(1, "# C:\\models\\"), (2, "v 1"), (3, " #\\"), (4, "v 2 # x v 3")];
        let text = b"# C:\\models\\\nv 1\n #\\\r\nv 2 # x\\\nv 3";
        assert_eq!(lines_of(text), expected.map(|(n, s)| (n, s.to_owned())));
    }

    #[test]
    fn byte_order_mark_is_no_text() {
        assert_eq!(lines_of(b"\xef\xbb\xbfv 1"), [(1, "v 1".to_owned())]);
    }

    #[test]
    fn endless_line_is_refused() {
        let mut lines = LogicalLines::new(io::BufReader::new(io::repeat(b'x')));
        assert!(lines.next_line().unwrap_err().to_string().contains("line 1 is longer"));
    }
}
