#pragma once
/// Field lists: name, unit and meaning of a value type's members, said once, beside the struct.
///
///     struct Absorbed {
///       std::string effect;
///       double visible_share = 0.0;
///
///       template <class List>
///       static constexpr void fields(List& list) {
///         list.type("Absorbed", "An effect that this recording cannot show beside the base.");
///         list.field("effect", &Absorbed::effect, "Its name.");
///         list.field("visible_share", &Absorbed::visible_share, "Of its torque.");
///       }
///     };
///
/// Files both ways (src/runs/fields_json.hpp), JSON schemas and their pages, Python classes with
/// repr, pickle and docstrings (python/value_type.hpp) and the stub are visitors of this list
/// (docs/extend/field.md). Its order is that of the files' keys. Besides field() it may call
///
///     list.in_memory("model", &Fit::model, "…");       // in no file: C++ and Python alone have it
///     list.columns("curve", &Policy::curve, "…");      // in files: an object, a column a field
///     list.embed(&Run::finding);                       // fields of a member count as its own
///     list.also("rows", &Fit::summary, &Summary::rows);  // in files: a member's field, its
///     meaning list.derived("rank", function, "…");               // in files: computed, not read
///     list.custom("rmse", "…");                          // in files: by code of its own
///
/// each with FieldTraits. A struct with a member that its list does not name fails to compile.

#include <concepts>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include <diffnea/core/error.hpp>

namespace diffnea {

/// Files of a run that hold a field.
enum RunFile : unsigned {
  kWhereItsTypeIs = 0,  ///< files of the type: both, unless type() says otherwise
  kInResult = 1,        ///< result.json, and what a command prints
  kInSeries = 2,        ///< series.json
  kInBoth = kInResult | kInSeries,
};

/// Traits of a field besides its name and meaning.
struct FieldTraits {
  const char* unit = "";            ///< SI; "unit": that of the struct's field `unit`
  const char* key = nullptr;        ///< in files, if not the name: "class", "apart.base", "ci95[0]"
  RunFile files = kWhereItsTypeIs;  ///< files that hold it
  bool optional = false;            ///< earlier versions of the file lack it
  bool empty_is_null = false;       ///< an empty text, or a number that is not above 0, is null
  double null = std::numeric_limits<double>::quiet_NaN();  ///< number that null is read as
  const char* choices = "";    ///< values of a text: "refit|prior|fixed"
  bool absent = false;         ///< where it is empty, the key is left out
  const char* same = nullptr;  ///< key by which items of series.json belong to result.json's
  const char* item = "";       ///< such an item in words, for messages
};

/// Traits of all fields of a type.
struct TypeTraits {
  RunFile files = kInBoth;  ///< files of fields that do not say
  bool columns = false;     ///< lists of numbers in series.json are columns of equal length
  long most_rows = 0;       ///< most values of such a column, others are thinned; 0: any number
  bool exact = false;       ///< reading: every key has its value, and there is no other key
};

namespace detail {

struct FieldCounter {
  int count = 0;

  constexpr void type(const char*, const char*, TypeTraits = {}) {}
  template <class T, class F>
  constexpr void field(const char*, F T::*, const char*, FieldTraits = {}) {
    ++count;
  }
  template <class T, class F>
  constexpr void in_memory(const char*, F T::*, const char*, FieldTraits = {}) {
    ++count;
  }
  template <class T, class F>
  constexpr void columns(const char*, F T::*, const char*, FieldTraits = {}) {
    ++count;
  }
  template <class T, class F>
  constexpr void embed(F T::*) {
    ++count;
  }
  template <class T, class M, class F>
  constexpr void also(const char*, M T::*, F M::*, const char* = "", FieldTraits = {}) {}
  template <class Function>
  constexpr void derived(const char*, Function, const char*, FieldTraits = {}) {}
  constexpr void custom(const char*, const char*, FieldTraits = {}) {}
};

struct AnyMember {
  template <class T>
  operator T() const;
};

/// Number of members of an aggregate.
template <class T, class... Members>
consteval int member_count() {
  if constexpr (requires { T{Members{}..., AnyMember{}}; })
    return member_count<T, Members..., AnyMember>();
  else
    return sizeof...(Members);
}

template <class T>
consteval int listed_fields() {
  FieldCounter counter;
  T::fields(counter);
  return counter.count;
}

}  // namespace detail

/// Has a list of its fields.
template <class T>
concept Described = requires(detail::FieldCounter& list) { T::fields(list); };

/// Shows a visitor the list of a type.
template <Described T, class Visitor>
void visit_fields(Visitor& visitor) {
  static_assert(detail::listed_fields<T>() == detail::member_count<T>(),
                "the struct has other members than its list of fields: name each of them there");
  T::fields(visitor);
}

/// A value of an enumeration and its name in files and in Python.
template <class E>
struct NamedValue {
  E value;           ///< of the enumeration
  const char* name;  ///< in files and in Python
};

/// `static constexpr NamedValue<E> list[]` for an enumeration that has names.
template <class E>
struct EnumNames;

/// Its values have names.
template <class E>
concept NamedEnum = std::is_enum_v<E> && requires { EnumNames<E>::list; };

/// Name of a value in files and in Python.
template <NamedEnum E>
constexpr const char* name_of(E value) {
  for (const NamedValue<E>& each : EnumNames<E>::list)
    if (each.value == value) return each.name;
  return "";
}

/// Names of all values, in their order.
template <NamedEnum E>
std::vector<std::string> names_of() {
  std::vector<std::string> out;
  for (const NamedValue<E>& each : EnumNames<E>::list) out.emplace_back(each.name);
  return out;
}

/// The value of that name. @param where  begins the message @throws ModelError with the choices
template <NamedEnum E>
E value_of(const std::string& name, const std::string& where) {
  std::string choices;
  for (const NamedValue<E>& each : EnumNames<E>::list) {
    if (name == each.name) return each.value;
    choices += (choices.empty() ? "" : ", ") + std::string(each.name);
  }
  throw ModelError(where + ": got '" + name + "'; choices: " + choices);
}

}  // namespace diffnea
