#include <diffnea/model/detail/model_impl.hpp>
