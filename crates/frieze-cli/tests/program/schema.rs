//! As much of JSON Schema as our own schema uses. Unknown keywords fail, so that none is silently skipped;
//! and so do fields that the schema does not know.

use serde_json::Value;

/// Whether `value` fits `schema`; `place` is a JSON pointer for the message.
pub fn check(root: &Value, schema: &Value, value: &Value, place: &str) -> Result<(), String> {
    let fail = |what: String| Err(format!("{place}: {what}"));
    let list = |v: &Value| v.as_array().cloned().unwrap_or_default();
    for (key, rule) in schema.as_object().expect("a schema is an object") {
        match key.as_str() {
            "$schema" | "title" | "description" | "$defs" | "required" => {}
            "$ref" => {
                let target = root.pointer(rule.as_str().unwrap().trim_start_matches('#')).expect("the reference");
                check(root, target, value, place)?;
            }
            "oneOf" | "anyOf" => {
                let results: Vec<_> = list(rule).iter().map(|s| check(root, s, value, place)).collect();
                let fits = results.iter().filter(|r| r.is_ok()).count();
                if fits == 0 || key == "oneOf" && fits != 1 {
                    let why: Vec<String> = results.into_iter().filter_map(Result::err).collect();
                    return fail(format!("fits {fits} of {key}:\n{}", why.join("\n")));
                }
            }
            "const" if rule != value => return fail(format!("is {value}, not {rule}")),
            "enum" if !list(rule).contains(value) => return fail(format!("{value} is none of {rule}")),
            "const" | "enum" => {}
            "type" => {
                let fits = match rule.as_str().unwrap() {
                    "object" => value.is_object(),
                    "array" => value.is_array(),
                    "string" => value.is_string(),
                    "number" => value.is_number(),
                    "integer" => value.is_u64() || value.is_i64(),
                    "boolean" => value.is_boolean(),
                    "null" => value.is_null(),
                    other => panic!("type {other}"),
                };
                if !fits {
                    return fail(format!("{value} is no {rule}"));
                }
            }
            "properties" => {
                let Some(fields) = value.as_object() else { continue };
                for (name, field) in fields {
                    let Some(s) = rule.get(name) else { return fail(format!("unknown field {name}")) };
                    check(root, s, field, &format!("{place}/{name}"))?;
                }
                for name in list(&schema["required"]) {
                    if !fields.contains_key(name.as_str().unwrap()) {
                        return fail(format!("{name} is missing"));
                    }
                }
            }
            "additionalProperties" => {
                for (name, field) in value.as_object().into_iter().flatten() {
                    check(root, rule, field, &format!("{place}/{name}"))?;
                }
            }
            "items" => {
                for (k, item) in list(value).iter().enumerate() {
                    check(root, rule, item, &format!("{place}/{k}"))?;
                }
            }
            "minItems" if (list(value).len() as u64) < rule.as_u64().unwrap() => return fail("too few items".into()),
            "maxItems" if (list(value).len() as u64) > rule.as_u64().unwrap() => return fail("too many items".into()),
            "minimum" if value.as_f64() < rule.as_f64() => return fail(format!("{value} is below {rule}")),
            "pattern" if !value.as_str().unwrap().starts_with(rule.as_str().unwrap().trim_start_matches('^')) => {
                return fail(format!("{value} does not match {rule}"));
            }
            "minItems" | "maxItems" | "minimum" | "pattern" => {}
            other => panic!("the schema has a keyword that this test does not know: {other}"),
        }
    }
    Ok(())
}
