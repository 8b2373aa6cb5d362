//! Choices that have names: how they are typed, and how they are told.

/// The name of a choice that is among `all`.
pub fn name_of<T: PartialEq>(all: &[(&'static str, T)], choice: &T) -> &'static str {
    all.iter().find(|(_, one)| one == choice).expect("every choice has a name").0
}

/// The choice that has a name, or a sentence that names all. `what` is what it would be: `integrator` makes "'fast' is
/// no integrator".
pub fn by_name<T: Copy>(what: &str, all: &[(&'static str, T)], text: &str) -> Result<T, String> {
    all.iter().find(|(name, _)| *name == text).map(|&(_, choice)| choice).ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|(name, _)| *name).collect();
        format!("'{text}' is no {what}: choose from {}", names.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_to_choices_and_back() {
        let all = [("one", 1), ("two", 2)];
        assert_eq!((name_of(&all, &2), by_name("number", &all, "one")), ("two", Ok(1)));
        assert_eq!(by_name("number", &all, "six").unwrap_err(), "'six' is no number: choose from one, two");
    }
}
