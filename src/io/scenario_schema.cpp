#include "io/scenario_keys.hpp"

#include <nlohmann/json.hpp>
#include <variant>

namespace pendula::io {
namespace {

using Json = nlohmann::ordered_json;

Json table_schema(const ScenarioTable& table);

Json array_of(const Json& items) {
  return {{"type", "array"}, {"items", items}};
}

/// Strings have a unit.
Json number_schema(const ScenarioKey& key) {
  Json schema{{"type", "number"}};
  if (key.bound.least > any_number.least)
    schema[key.bound.is_excluded ? "exclusiveMinimum" : "minimum"] = key.bound.least;
  if (key.unit == "1") return schema;
  return {{"anyOf", {schema, {{"type", "string"}}}}};
}

Json value_schema(const ScenarioKey& key, const std::string& name) {
  switch (key.type) {
    case KeyType::number:
      return number_schema(key);
    case KeyType::integer:
      return {{"type", "integer"}, {"minimum", key.least}, {"maximum", key.most}};
    case KeyType::truth:
      return {{"type", "boolean"}};
    case KeyType::text:
      return {{"type", "string"}, {"minLength", 1}};
    case KeyType::choice:
      return {{"enum", std::vector<std::string>(key.choices.begin(), key.choices.end())}};
    case KeyType::per_link:
      return {{"anyOf", {number_schema(key), array_of(number_schema(key))}}};
    case KeyType::torque: {
      const Json number = number_schema(key);
      return {{"anyOf", {number, array_of(number), array_of(array_of(number))}}};
    }
    case KeyType::numbers:
      return array_of(number_schema(key));
    case KeyType::texts:
      return array_of({{"type", "string"}});
    case KeyType::columns:
      return {{"type", "object"}, {"additionalProperties", {{"type", "string"}, {"minLength", 1}}}};
    case KeyType::names:
      return {{"type", "object"}};
    case KeyType::table:
      return table_schema(table_named(name));
    case KeyType::tables:
      break;
  }
  return array_of(table_schema(table_named(name)));
}

Json key_schema(const ScenarioKey& key, const std::string& name) {
  Json schema = value_schema(key, name);
  schema["description"] = key.hint;
  if (!key.unit.empty()) schema["x-unit"] = key.unit;
  schema["x-type"] = type_text(key);
  schema["x-default"] = default_text(key);
  std::visit(
      [&](const auto& value) {
        using Value = std::decay_t<decltype(value)>;
        if constexpr (!std::is_same_v<Value, Required> && !std::is_same_v<Value, InWords>) schema["default"] = value;
      },
      key.otherwise);
  return schema;
}

/// Models have keys of their own in [start].
Json table_schema(const ScenarioTable& table) {
  Json schema{{"type", "object"}, {"properties", Json::object()}, {"additionalProperties", table.name == "start"}};
  for (const ScenarioKey& key : table.keys) {
    const std::string name = (table.name.empty() ? "" : std::string(table.name) + ".") + std::string(key.name);
    schema["properties"][std::string(key.name)] = key_schema(key, name);
    if (std::holds_alternative<Required>(key.otherwise) && table.name != "start") {
      schema["required"].push_back(key.name);
    }
  }
  return schema;
}

}  // namespace

std::string scenario_schema() {
  Json schema{{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", "Scenario of pendula"}};
  schema.update(table_schema(table_named("")));
  schema["oneOf"] = {{{"required", {"chain"}}}, {{"required", {"system"}}}};
  return schema.dump(2) + "\n";
}

}  // namespace pendula::io
