#pragma once
/// Described types (diffnea/core/fields.hpp) as JSON Schema.

#include <array>

#include "runs/fields_json.hpp"

namespace diffnea::io {

/// Doc and unit of a field, as the list of its own type has them.
template <class M, class F>
struct FieldText {
  F M::* wanted;
  const char* doc = "";
  FieldTraits traits;

  void type(const char*, const char*, TypeTraits = {}) {}
  template <class G>
  void field(const char*, G M::* member, const char* its_doc, FieldTraits its = {}) {
    if constexpr (std::is_same_v<F, G>)
      if (member == wanted) {
        doc = its_doc;
        traits = its;
      }
  }
  template <class G>
  void in_memory(const char* name, G M::* member, const char* its_doc, FieldTraits its = {}) {
    field(name, member, its_doc, its);
  }
  template <class G>
  void columns(const char*, G M::*, const char*, FieldTraits = {}) {}
  template <class G>
  void embed(G M::*) {}
  template <class N, class G>
  void also(const char*, N M::*, G N::*, const char* = "", FieldTraits = {}) {}
  template <class Function>
  void derived(const char*, Function, const char*, FieldTraits = {}) {}
  void custom(const char*, const char*, FieldTraits = {}) {}
};

/// Adds a property at a path to an object's schema. @param required  it is never left out
void put_property(Json& object, const char* path, Json&& property, bool required = true);
/// Description in the words of JSON, without the type that the schema says, and the unit.
void describe(Json& property, const std::string& doc, const FieldTraits& traits);
/// Texts separated by "|".
Json choices(const char* text);

/// Puts the schema of a type's object, and those that it refers to, into `defs`. @return its name
template <Described T>
std::string define(RunFile file, Json& defs);

template <class F>
Json schema_of(const FieldTraits& traits, RunFile file, Json& defs) {
  if constexpr (std::is_same_v<F, bool>) {
    return {{"type", "boolean"}};
  } else if constexpr (std::is_integral_v<F>) {
    return {{"type", "integer"}};
  } else if constexpr (std::is_same_v<F, double> || std::is_same_v<F, DecimatorOptions>) {
    return {{"type", {"number", "null"}}};
  } else if constexpr (std::is_same_v<F, std::string>) {
    if (*traits.choices) return {{"enum", choices(traits.choices)}};
    if (traits.empty_is_null) return {{"type", {"string", "null"}}};
    return {{"type", "string"}};
  } else if constexpr (std::is_same_v<F, VecX<double>>) {
    return {{"type", "array"}, {"items", {{"type", "number"}}}};
  } else if constexpr (is_matrix<F>) {
    return {{"type", "array"}, {"items", schema_of<VecX<double>>({}, file, defs)}};
  } else if constexpr (NamedEnum<F>) {
    Json names = Json::array();
    for (const auto& each : EnumNames<F>::list) names.push_back(each.name);
    return {{"enum", names}};
  } else if constexpr (is_optional<F>) {
    return {{"anyOf", {schema_of<typename F::value_type>(traits, file, defs), {{"type", "null"}}}}};
  } else if constexpr (requires { typename std::tuple_size<F>::type; }) {
    return {{"type", "array"},
            {"items", schema_of<typename F::value_type>({}, file, defs)},
            {"minItems", std::tuple_size_v<F>},
            {"maxItems", std::tuple_size_v<F>}};
  } else if constexpr (is_vector<F>) {
    return {{"type", "array"}, {"items", schema_of<typename F::value_type>({}, file, defs)}};
  } else {
    static_assert(Described<F>, "a field of a type that has no list and no schema of its own");
    return {{"$ref", "#/$defs/" + define<F>(file, defs)}};
  }
}

/// Columns of a described type.
template <class T>
struct ColumnSchema {
  Json object{{"type", "object"}, {"required", Json::array()}, {"properties", Json::object()}};

  void type(const char*, const char*, TypeTraits = {}) {}
  template <class F>
  void field(const char* name, F T::*, const char* doc, FieldTraits traits = {}) {
    Json column{{"type", "array"}, {"items", {{"type", "number"}}}};
    describe(column, doc, traits);
    put_property(object, name, std::move(column));
  }
  template <class F>
  void in_memory(const char*, F T::*, const char*, FieldTraits = {}) {}
};

template <Described T>
Json columns_schema() {
  ColumnSchema<T> columns;
  visit_fields<T>(columns);
  return columns.object;
}

/// Collects the properties of a type.
template <class T>
class SchemaWriter {
 public:
  SchemaWriter(Json& object, RunFile file, Json& defs)
      : object_(object), file_(file), defs_(defs) {}

  void type(const char* name, const char* doc, TypeTraits traits = {}) {
    name_ = name;
    doc_ = doc;
    type_ = traits;
  }
  template <class F>
  void field(const char* name, F T::*, const char* doc, FieldTraits traits = {}) {
    add<F>(traits.key ? traits.key : name, doc, traits, traits);
  }
  template <class F>
  void in_memory(const char*, F T::*, const char*, FieldTraits = {}) {}
  template <class E>
  void columns(const char* name, std::vector<E> T::*, const char* doc, FieldTraits traits = {}) {
    if (!stands_in(file_, traits, type_.files)) return;
    Json property = columns_schema<E>();
    describe(property, doc, traits);
    put_property(object_, name, std::move(property));
  }
  template <class M>
  void embed(M T::*) {
    SchemaWriter<M> writer(object_, file_, defs_);
    visit_fields<M>(writer);
  }
  template <class M, class F>
  void also(const char* key, M T::*, F M::* member, const char* doc = "", FieldTraits traits = {}) {
    FieldText<M, F> text{.wanted = member, .doc = "", .traits = {}};
    if constexpr (Described<M>) visit_fields<M>(text);
    add<F>(key, *doc ? doc : text.doc, traits, *doc ? traits : text.traits);
  }
  template <class Function>
  void derived(const char* key, Function, const char* doc, FieldTraits traits = {}) {
    add<std::remove_cvref_t<std::invoke_result_t<Function, const T&>>>(key, doc, traits, traits);
  }
  void custom(const char* key, const char* doc, FieldTraits traits = {}) {
    if (!stands_in(file_, traits, type_.files)) return;
    Json property = custom_schema(static_cast<const T*>(nullptr), key, file_);
    describe(property, doc, traits);
    put_property(object_, key, std::move(property));
  }

  const char* name() const { return name_; }
  const char* doc() const { return doc_; }
  bool exact() const { return type_.exact; }

 private:
  template <class F>
  void add(const char* key, const char* doc, const FieldTraits& traits, const FieldTraits& text) {
    if (!stands_in(file_, traits, type_.files)) return;
    Json property = schema_of<F>(traits, file_, defs_);
    if constexpr (std::is_same_v<F, std::vector<double>>)
      if (type_.most_rows > 0) property["maxItems"] = type_.most_rows;
    describe(property, doc, text);
    put_property(object_, key, std::move(property), !traits.absent);
  }

  Json& object_;
  RunFile file_;
  Json& defs_;
  TypeTraits type_;
  const char* name_ = "";
  const char* doc_ = "";
};

template <Described T>
std::string define(RunFile file, Json& defs) {
  Json object{{"type", "object"}, {"required", Json::array()}, {"properties", Json::object()}};
  SchemaWriter<T> writer(object, file, defs);
  visit_fields<T>(writer);
  if (writer.exact()) object["additionalProperties"] = false;
  describe(object, writer.doc(), {});
  defs[writer.name()] = std::move(object);
  return writer.name();
}

/// Schema of a whole file. @param title  "result.json of `diffnea diagnose`"
template <Described T>
std::string file_schema(const std::string& schema, const char* title, RunFile file) {
  Json defs = Json::object();
  Json out{{"$schema", "https://json-schema.org/draft/2020-12/schema"},
           {"title", title},
           {"type", "object"},
           {"required", {"schema"}},
           {"properties", {{"schema", {{"const", schema}}}}}};
  SchemaWriter<T> writer(out, file, defs);
  visit_fields<T>(writer);
  out["$defs"] = defs;
  return text(out, 1);
}

}  // namespace diffnea::io
