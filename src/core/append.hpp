#pragma once
/// One list after another. Internal to the library.

#include <vector>

namespace diffnea {

template <class T>
void append(const std::vector<T>& from, std::vector<T>& to) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace diffnea
