//! The statistics of a render in words.

use super::quantity::{Bytes, Count, plural};
use super::statistics::{GeometryReport, RenderStatistics, Seconds};
use crate::render::Reason;
use std::fmt::{self, Display, Formatter};

impl Display for RenderStatistics {
    /// A paragraph for each subject, for a terminal; with a line end.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.write_picture(f)?;
        self.write_rays(f)?;
        self.write_groups(f)?;
        self.write_geometry(f)?;
        self.write_cache(f)?;
        self.write_memory(f)?;
        self.write_time(f)
    }
}

impl RenderStatistics {
    fn write_picture(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let p = &self.picture;
        let unfinished = if p.pixels_done < p.pixels { " (interrupted)" } else { "" };
        let (done, samples) = (Count(p.pixels_done as u64), plural(u64::from(p.spp), "sample"));
        writeln!(f, "picture   {} x {}, {done} pixels rendered{unfinished}, {samples} each", p.width, p.height)
    }

    fn write_rays(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let c = &self.rays.counts;
        let kinds = [
            (c.primary, "primary"),
            (c.shadow, "shadow"),
            (c.reflection, "reflection"),
            (c.refraction, "refraction"),
            (c.occlusion, "occlusion"),
            (c.diffuse, "diffuse"),
        ];
        let used: Vec<_> =
            kinds.iter().filter(|(n, _)| *n > 0).map(|(n, kind)| format!("{} {kind}", Count(*n))).collect();
        let list = if used.is_empty() { String::new() } else { format!(": {}", used.join(", ")) };
        let rate = Count(per_second(self.rays.total, self.seconds.render));
        writeln!(f, "rays      {}{list}; {rate} a second", Count(self.rays.total))
    }

    fn write_groups(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let g = &self.groups;
        if g.traced_pixels == self.picture.pixels_done as u64 {
            return Ok(());
        }
        let (traced, share) = (Count(g.traced_pixels), percent(g.traced_pixels, self.picture.pixels_done as u64));
        let [interpolated, background] = [Reason::Interpolated, Reason::Background].map(|r| Count(g.pixels.of(r)));
        writeln!(
            f,
            "groups    {traced} pixels traced ({share}), {interpolated} interpolated, {background} of background"
        )
    }

    fn write_geometry(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let g = &self.geometry;
        let (touched, patches) = (Count(g.patches_touched as u64), Count(g.patches as u64));
        let share = percent(g.patches_touched as u64, g.patches as u64);
        writeln!(f, "patches   {touched} of {patches} touched ({share}), {} grids built", Count(g.grids_built))?;
        let GeometryReport { full_triangles, full_bytes, .. } = *g;
        writeln!(f, "in full   {} triangles, about {}: never built", Count(full_triangles), Bytes(full_bytes))
    }

    fn write_cache(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let c = &self.cache;
        let size = c.capacity_bytes.map_or("unbounded".to_owned(), |bytes| Bytes(bytes).to_string());
        let (hits, private) = (percent(c.hits, c.lookups), percent(c.private_hits, c.lookups));
        let own = if c.private_hits > 0 { format!(", {private} a thread's own block") } else { String::new() };
        writeln!(
            f,
            "cache     {size}, at most {} in use; {hits} of {} lookups hit{own}",
            Bytes(c.peak_bytes),
            Count(c.lookups)
        )?;
        let (first, again, other) = (Count(c.compulsory_misses), Count(c.capacity_misses), Count(c.other_misses));
        writeln!(
            f,
            "misses    {first} compulsory, {again} for lack of room, {other} other; {} built",
            Bytes(c.bytes_built)
        )
    }

    fn write_memory(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let peak = self.memory.peak_resident_bytes.map_or("unknown".to_owned(), |bytes| Bytes(bytes).to_string());
        let budget = self.memory.budget_bytes.map_or(String::new(), |bytes| format!(" of {} allowed", Bytes(bytes)));
        writeln!(f, "memory    {peak} at most{budget}, {} of it for the scene", Bytes(self.geometry.resident_bytes))
    }

    fn write_time(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let s = &self.seconds;
        let [load, prepare, render, write] = [s.load, s.prepare, s.render, s.write].map(|phase| phase.wall);
        let (total, threads) = (s.total().wall, plural(self.threads as u64, "thread"));
        writeln!(
            f,
            "seconds   {total:.2}: load {load:.2}, prepare {prepare:.2}, render {render:.2}, write {write:.2}; {threads}"
        )
    }
}

fn per_second(n: u64, seconds: Seconds) -> u64 {
    if seconds.wall > 0.0 { (n as f64 / seconds.wall) as u64 } else { 0 }
}

/// A share with one decimal that says 100 % only if nothing is missing and 0 % only if nothing is there.
fn percent(part: u64, whole: u64) -> String {
    let share = if whole == 0 { 0.0 } else { 100.0 * part as f64 / whole as f64 };
    let bounded = if part == 0 || part >= whole { share } else { share.clamp(0.1, 99.9) };
    format!("{bounded:.1} %")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::RayCounts;

    #[test]
    fn a_summary_tells_what_was_saved() {
        let mut s = RenderStatistics { threads: 2, ..Default::default() };
        (s.picture.width, s.picture.height, s.picture.pixels, s.picture.pixels_done) = (800, 600, 480_000, 480_000);
        s.picture.spp = 1;
        s.groups.traced_pixels = 120_000;
        s.groups.pixels.add(Reason::Interpolated, 300_000);
        s.groups.pixels.add(Reason::Background, 60_000);
        s.rays = RayCounts { primary: 480_000, shadow: 1_200_000, ..Default::default() }.into();
        s.seconds.render = (2.0, 4.0).into();
        (s.geometry.patches, s.geometry.patches_touched, s.geometry.grids_built) = (11_000, 10_999, 70_000);
        (s.geometry.full_triangles, s.geometry.full_bytes) = (91_000_000, 700 << 20);
        (s.cache.capacity_bytes, s.cache.lookups, s.cache.hits) = (Some(16 << 20), 1000, 0);
        s.memory.peak_resident_bytes = Some(100 << 20);
        let expected = "\
picture   800 x 600, 480,000 pixels rendered, 1 sample each
rays      1,680,000: 480,000 primary, 1,200,000 shadow; 840,000 a second
groups    120,000 pixels traced (25.0 %), 300,000 interpolated, 60,000 of background
patches   10,999 of 11,000 touched (99.9 %), 70,000 grids built
in full   91,000,000 triangles, about 700.0 MiB: never built
cache     16.0 MiB, at most 0 bytes in use; 0.0 % of 1,000 lookups hit
misses    0 compulsory, 0 for lack of room, 0 other; 0 bytes built
memory    100.0 MiB at most, 0 bytes of it for the scene
seconds   2.00: load 0.00, prepare 0.00, render 2.00, write 0.00; 2 threads
";
        assert_eq!(s.to_string(), expected);
    }

    #[test]
    fn an_interrupted_render_says_so() {
        let mut s = RenderStatistics::default();
        (s.picture.pixels, s.picture.pixels_done) = (10, 3);
        assert!(s.to_string().contains("3 pixels rendered (interrupted)"));
    }

    #[test]
    fn shares_are_whole_only_if_nothing_is_missing() {
        assert_eq!([percent(1, 100_000), percent(0, 0), percent(7, 7)], ["0.1 %", "0.0 %", "100.0 %"]);
    }
}
