#pragma once
/// Described values (diffnea/core/fields.hpp) as JSON, both ways.
///
/// Out: a number that does not exist is null; lists of numbers in series.json have 6 digits. In:
/// keys that are not known are passed over; numbers, flags and lists may be missing, texts and
/// columns only where the list says so. Exact types hold all their keys, and no other. What a list
/// calls custom is written and read by overloads of custom_json() and read_custom() in the
/// namespace of the type.

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include <diffnea/core/fields.hpp>
#include <diffnea/core/scalar.hpp>
#include <diffnea/recording/decimator.hpp>

#include "runs/json_numbers.hpp"
#include "runs/run_reader.hpp"

namespace diffnea::io {

template <class T>
constexpr bool is_vector = false;
template <class T>
constexpr bool is_vector<std::vector<T>> = true;
template <class T>
constexpr bool is_optional = false;
template <class T>
constexpr bool is_optional<std::optional<T>> = true;

template <class F>
constexpr bool is_matrix = std::is_same_v<F, MatX<double>> || std::is_same_v<F, RowMatX<double>>;

/// True if `file` is among those of a field.
constexpr bool stands_in(RunFile file, const FieldTraits& field, RunFile of_type) {
  return ((field.files == kWhereItsTypeIs ? of_type : field.files) & file) != 0;
}

/// Puts a value at a path: "key", "outer.key", "key[0]".
void put(Json& out, const char* path, Json&& value);

/// Every n-th value, so that at most `most` are left; 0: all.
std::vector<double> thinned(const std::vector<double>& values, long most);

template <Described T>
Json fields_json(const T& x, RunFile file);

template <class F>
Json json_of(const F& x, RunFile file) {
  if constexpr (std::is_same_v<F, double>) {
    return number(x);
  } else if constexpr (std::is_same_v<F, std::vector<double>>) {
    return file == kInSeries ? rounded(x) : Json(x);
  } else if constexpr (std::is_same_v<F, DecimatorOptions>) {
    return number(x.rate_hz / x.factor);
  } else if constexpr (std::is_same_v<F, VecX<double>>) {
    return std::vector<double>(x.begin(), x.end());
  } else if constexpr (is_matrix<F>) {
    Json rows = Json::array();
    for (long i = 0; i < x.rows(); ++i)
      rows.push_back(std::vector<double>(x.row(i).begin(), x.row(i).end()));
    return rows;
  } else if constexpr (NamedEnum<F>) {
    return name_of(x);
  } else if constexpr (is_optional<F>) {
    return x ? json_of(*x, file) : Json();
  } else if constexpr (Described<F>) {
    return fields_json(x, file);
  } else if constexpr (is_vector<F> && !requires { Json(x); }) {
    Json out = Json::array();
    for (const auto& item : x) out.push_back(json_of(item, file));
    return out;
  } else {
    return Json(x);
  }
}

/// Adds the values of a described item to an object of columns.
template <class T>
struct ColumnWriter {
  const T& x;
  Json& out;

  void type(const char*, const char*, TypeTraits = {}) {}
  void field(const char* name, double T::* member, const char*, FieldTraits = {}) {
    out[name].push_back(x.*member);
  }
  template <class F>
  void in_memory(const char*, F T::*, const char*, FieldTraits = {}) {}
};

/// One column a field.
template <Described T>
Json columns_json(const std::vector<T>& items) {
  Json out = Json::object();
  const T none{};
  ColumnWriter<T> names{none, out};
  visit_fields<T>(names);
  for (auto& column : out) column = Json::array();
  for (const T& item : items) {
    ColumnWriter<T> writer{item, out};
    visit_fields<T>(writer);
  }
  return out;
}

/// Writes the fields of a value into an object.
template <class T>
class FieldWriter {
 public:
  FieldWriter(const T& x, Json& out, RunFile file) : x_(x), out_(out), file_(file) {}

  void type(const char*, const char*, TypeTraits traits = {}) { type_ = traits; }
  template <class F>
  void field(const char* name, F T::* member, const char*, FieldTraits traits = {}) {
    write(traits.key ? traits.key : name, x_.*member, traits);
  }
  template <class F>
  void in_memory(const char*, F T::*, const char*, FieldTraits = {}) {}
  template <class F>
  void columns(const char* name, F T::* member, const char*, FieldTraits traits = {}) {
    if (stands_in(file_, traits, type_.files)) put(out_, name, columns_json(x_.*member));
  }
  template <class M>
  void embed(M T::* member) {
    FieldWriter<M> writer(x_.*member, out_, file_);
    visit_fields<M>(writer);
  }
  template <class M, class F>
  void also(const char* key, M T::* outer, F M::* member, const char* = "",
            FieldTraits traits = {}) {
    write(key, x_.*outer.*member, traits);
  }
  template <class Function>
  void derived(const char* key, Function function, const char*, FieldTraits traits = {}) {
    if (stands_in(file_, traits, type_.files)) write(key, std::invoke(function, x_), traits);
  }
  void custom(const char* key, const char*, FieldTraits traits = {}) {
    if (stands_in(file_, traits, type_.files)) put(out_, key, custom_json(x_, key, file_));
  }

 private:
  template <class F>
  void write(const char* key, const F& value, const FieldTraits& traits) {
    if (!stands_in(file_, traits, type_.files)) return;
    if (traits.absent && is_empty(value)) return;
    if (traits.empty_is_null && is_empty(value))
      put(out_, key, Json());
    else if constexpr (std::is_same_v<F, std::vector<double>>)
      put(out_, key, json_of(file_ == kInSeries ? thinned(value, type_.most_rows) : value, file_));
    else
      put(out_, key, json_of(value, file_));
  }
  template <class F>
  static bool is_empty(const F& value) {
    if constexpr (requires { value.empty(); })
      return value.empty();
    else if constexpr (is_optional<F>)
      return !value;
    else if constexpr (std::is_arithmetic_v<F>)
      return value <= F(0);
    else
      return false;
  }

  const T& x_;
  Json& out_;
  RunFile file_;
  TypeTraits type_;
};

template <Described T>
Json fields_json(const T& x, RunFile file) {
  Json out = Json::object();
  FieldWriter<T> writer(x, out, file);
  visit_fields<T>(writer);
  return out;
}

/// A whole file: schema first, then the fields.
template <Described T>
std::string file_text(const char* schema, const T& x, RunFile file) {
  Json out{{"schema", schema}};
  FieldWriter<T> writer(x, out, file);
  visit_fields<T>(writer);
  return text(out, file == kInSeries ? -1 : 1);
}

// --- in

/// Where a path ends: the object that holds its last key, nothing if that may be missing and is.
struct PathEnd {
  std::optional<JsonObject> object;  ///< empty: the one that was given
  std::string key;                   ///< in it, without its index
  int index = -1;                    ///< place of "key[0]"; −1: none
  bool missing = false;              ///< an object on the way is not there

  JsonObject& in(JsonObject& given) { return object ? *object : given; }
};
/// @throws ModelError if an object on the way is missing and must not be
PathEnd follow(JsonObject& object, const char* path, bool optional);

/// One of two numbers of a list, NaN where the key is missing. @throws ModelError unless it has 2
double interval_end(JsonObject& object, const char* key, int index);
/// @throws ModelError for what an integer cannot hold
std::vector<int> integers(JsonObject& object, const char* key);

/// A whole number. @throws ModelError
long read_integer(JsonObject& object, const char* key);
/// 0, 1, 2, … @throws ModelError
std::uint64_t read_unsigned(JsonObject& object, const char* key);
/// Finite numbers.
VecX<double> read_vector(JsonObject& object, const char* key);
/// Rows of one length.
RowMatX<double> read_rows(JsonObject& object, const char* key);
/// @throws ModelError unless there is one number an item
void check_column(JsonObject& object, const char* key, std::size_t got, std::size_t expected);

/// Reads a column into a field of all items.
template <class T>
struct ColumnReader {
  std::vector<T>& items;
  JsonObject& in;
  bool first = true;

  void type(const char*, const char*, TypeTraits = {}) {}
  void field(const char* name, double T::* member, const char*, FieldTraits = {}) {
    const std::vector<double> column = json_numbers(in.required(name), in.at(name));
    if (first) items.resize(column.size());
    first = false;
    check_column(in, name, column.size(), items.size());
    for (std::size_t i = 0; i < items.size(); ++i) items[i].*member = column[i];
  }
  template <class F>
  void in_memory(const char*, F T::*, const char*, FieldTraits = {}) {}
};

template <Described T>
void read_fields(T& x, JsonObject& object, RunFile file);

/// Reads from exact files (TypeTraits::exact) the types whose reading is lenient elsewhere.
/// @return false for other types
template <class F>
bool read_exact(F& x, JsonObject& o, const char* key, const FieldTraits& traits) {
  if (traits.optional || traits.absent) return false;
  if constexpr (std::is_same_v<F, double>) {
    if (std::isnan(traits.null)) {
      x = o.number(key);
      return true;
    }
  } else if constexpr (std::is_same_v<F, bool>) {
    o.required(key);
    x = o.boolean_or(key, false);
    return true;
  } else if constexpr (std::is_same_v<F, std::uint64_t>) {
    x = read_unsigned(o, key);
    return true;
  } else if constexpr (std::is_integral_v<F>) {
    const long value = read_integer(o, key);
    x = static_cast<F>(value);
    if (x != value)
      throw ModelError(o.at(key) + ": got " + std::to_string(value) + ", which is too large");
    return true;
  } else if constexpr (is_vector<F> || is_optional<F>) {
    o.required(key);
  }
  return false;
}

template <class F>
void read_value(F& x, JsonObject& o, const char* key, const FieldTraits& traits, RunFile file,
                bool exact = false) {
  if (exact && read_exact(x, o, key, traits)) return;
  if constexpr (std::is_same_v<F, double>) {
    x = o.number_or(key, traits.empty_is_null ? 0.0 : traits.null);
  } else if constexpr (std::is_same_v<F, bool>) {
    x = o.boolean_or(key, false);
  } else if constexpr (std::is_integral_v<F>) {
    x = static_cast<F>(count(o, key));
  } else if constexpr (std::is_same_v<F, std::string>) {
    x = traits.optional || traits.empty_is_null ? o.string_or(key, x) : o.string(key);
  } else if constexpr (NamedEnum<F>) {
    if (!traits.optional || o.optional(key)) x = value_of<F>(o.string(key), o.at(key));
  } else if constexpr (std::is_same_v<F, DecimatorOptions>) {
    x = {.rate_hz = number_or_nan(o, key), .factor = 1};
  } else if constexpr (std::is_same_v<F, std::vector<double>>) {
    if (!traits.optional || o.optional(key)) x = column(o, key);
  } else if constexpr (std::is_same_v<F, VecX<double>>) {
    x = read_vector(o, key);
  } else if constexpr (is_matrix<F>) {
    x = read_rows(o, key);
  } else if constexpr (std::is_same_v<F, std::vector<int>>) {
    x = integers(o, key);
  } else if constexpr (std::is_same_v<F, std::vector<std::string>>) {
    x = strings(o, key);
  } else if constexpr (std::is_same_v<F, std::vector<std::vector<double>>>) {
    x.clear();
    const Json& rows = o.required(key);
    for (const Json& row : json_array(rows, o.at(key)))
      x.push_back(json_numbers(row, o.at(key) + "[" + std::to_string(x.size()) + "]"));
  } else if constexpr (is_optional<F>) {
    if (o.optional(key)) read_value(x.emplace(), o, key, {}, file, exact);
  } else if constexpr (is_vector<F>) {
    for_each_object(o, key, [&](JsonObject& item) {
      if (!traits.same || file != kInSeries) {
        read_fields(x.emplace_back(), item, file);
        return;
      }
      const std::string name = item.string(traits.same);
      for (auto& each : x)
        if (fields_json(each, kInResult).at(traits.same) == name)
          return read_fields(each, item, file);
      throw ModelError(item.at(traits.same) + ": got '" + name + "', which result.json has no " +
                       traits.item + " of");
    });
  } else {
    static_assert(Described<F>, "a field of a type that has no list and no JSON of its own");
    if ((traits.optional || traits.absent) && !o.optional(key)) return;
    JsonObject object(o.required(key), o.at(key));
    read_fields(x, object, file);
  }
}

/// Reads the fields of a value from an object.
template <class T>
class FieldReader {
 public:
  FieldReader(T& x, JsonObject& in, RunFile file) : x_(x), in_(in), file_(file) {}

  void type(const char*, const char*, TypeTraits traits = {}) { type_ = traits; }
  template <class F>
  void field(const char* name, F T::* member, const char*, FieldTraits traits = {}) {
    read(traits.key ? traits.key : name, x_.*member, traits);
  }
  template <class F>
  void in_memory(const char*, F T::*, const char*, FieldTraits = {}) {}
  template <class E>
  void columns(const char* name, std::vector<E> T::* member, const char*, FieldTraits traits = {}) {
    if (!stands_in(file_, traits, type_.files)) return;
    JsonObject object(in_.required(name), in_.at(name));
    ColumnReader<E> reader{x_.*member, object};
    visit_fields<E>(reader);
    object.finish();
  }
  template <class M>
  void embed(M T::* member) {
    FieldReader<M> reader(x_.*member, in_, file_);
    visit_fields<M>(reader);
  }
  template <class M, class F>
  void also(const char* key, M T::* outer, F M::* member, const char* = "",
            FieldTraits traits = {}) {
    read(key, x_.*outer.*member, traits);
  }
  template <class Function>
  void derived(const char*, Function, const char*, FieldTraits = {}) {}
  void custom(const char* key, const char*, FieldTraits traits = {}) {
    if (stands_in(file_, traits, type_.files)) read_custom(x_, key, in_, file_);
  }

  /// Refuses other keys where the list is exact.
  void finish() {
    if (type_.exact) in_.finish();
  }

 private:
  template <class F>
  void read(const char* path, F& value, const FieldTraits& traits) {
    if (!stands_in(file_, traits, type_.files)) return;
    PathEnd end = follow(in_, path, traits.optional);
    if (end.missing) return;
    JsonObject& object = end.in(in_);
    if constexpr (std::is_same_v<F, double>)
      if (end.index >= 0) {
        value = interval_end(object, end.key.c_str(), end.index);
        return;
      }
    read_value(value, object, end.key.c_str(), traits, file_, type_.exact);
    if constexpr (std::is_same_v<F, std::vector<double>>)
      if (type_.columns && file_ == kInSeries) check_length(object, end.key.c_str(), value, traits);
  }
  /// @throws ModelError if a column has another length than the first
  void check_length(JsonObject& object, const char* key, const std::vector<double>& values,
                    const FieldTraits& traits) {
    if (first_.empty()) {
      first_ = object.at(key);
      rows_ = values.size();
    } else if (values.size() != rows_ && !(traits.optional && values.empty())) {
      throw ModelError(first_ + ": has " + std::to_string(rows_) + " values, another column " +
                       std::to_string(values.size()));
    }
  }

  T& x_;
  JsonObject& in_;
  RunFile file_;
  TypeTraits type_;
  std::string first_;  ///< column, as messages name it
  std::size_t rows_ = 0;
};

template <Described T>
void read_fields(T& x, JsonObject& object, RunFile file) {
  FieldReader<T> reader(x, object, file);
  visit_fields<T>(reader);
  reader.finish();
}

/// Reads a file of a run into a value. @throws FileError, ModelError naming file and key
template <Described T>
void read_file(T& x, const std::filesystem::path& folder, const char* schema, RunFile file) {
  const char* name = file == kInSeries ? "series.json" : "result.json";
  const std::string where = (folder / name).string();
  const Json document = run_file(folder, name);
  JsonObject root(document, where);
  require_schema(root, where, schema);
  read_fields(x, root, file);
}

}  // namespace diffnea::io
