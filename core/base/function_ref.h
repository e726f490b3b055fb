#pragma once

#include <utility>

namespace stellate::core {

template <typename Signature>
class FunctionRef;

// A reference to a callable of any type, which must outlive it: the parameter of a function that is
// compiled once, in its own source, and not for each body. Do not keep one: a lambda that was given
// as an argument is gone when the call returns.
//
//   double SumOf(std::size_t count, FunctionRef<double(std::size_t)> term);
//   SumOf(values.size(), [&](std::size_t i) { return values[i]; });
template <typename Result, typename... Arguments>
class FunctionRef<Result(Arguments...)> {
 public:
  template <typename Call>
  FunctionRef(const Call& call)  // NOLINT: a body is given as it is
      : object_(&call), call_([](const void* object, Arguments... arguments) -> Result {
          return (*static_cast<const Call*>(object))(std::forward<Arguments>(arguments)...);
        }) {}

  Result operator()(Arguments... arguments) const {
    return call_(object_, std::forward<Arguments>(arguments)...);
  }

 private:
  const void* object_;
  Result (*call_)(const void*, Arguments...);
};

}  // namespace stellate::core
