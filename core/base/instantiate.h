#pragma once

#include <type_traits>

// Compiles a template on the manifold's dimension k once, in its own source, for each k that this
// build meshes: 1 to 5, or 1 to 3 where STELLATE_HIGH_DIMENSIONS is off (CMakeLists.txt), which
// saves a quarter of the time that stellated takes to compile. A class is declared in its header,
// so that no other source compiles it, and instantiated in its source, after its members:
//
//   template <int K>
//   class Doubler {
//    public:
//     int Of(int n) const;
//   };
//   STELLATE_DECLARE_CLASS(Doubler)
//
//   template <int K>
//   int Doubler<K>::Of(int n) const { return 2 * n; }
//   STELLATE_INSTANTIATE_CLASS(Doubler)
//
// Members that are defined in a second source are instantiated there one by one, as functions are.
#ifdef STELLATE_LOW_DIMENSIONS
#define STELLATE_ABOVE_3(...)
#define STELLATE_LARGEST_DIMENSION 3
#else
#define STELLATE_ABOVE_3(...) __VA_ARGS__
#define STELLATE_LARGEST_DIMENSION 5
#endif

#define STELLATE_DECLARE_CLASS(Class) \
  extern template class Class<1>;     \
  extern template class Class<2>;     \
  extern template class Class<3>;     \
  STELLATE_ABOVE_3(extern template class Class<4>; extern template class Class<5>;)

#define STELLATE_INSTANTIATE_CLASS(Class) \
  template class Class<1>;                \
  template class Class<2>;                \
  template class Class<3>;                \
  STELLATE_ABOVE_3(template class Class<4>; template class Class<5>;)

// The same for functions: Each(k) is the instantiation for one k.
//
//   #define STELLATE_EACH(K) template int Tripled<K>(int);
//   STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
//   #undef STELLATE_EACH
#define STELLATE_INSTANTIATE_FUNCTIONS(Each) \
  Each(1) Each(2) Each(3) STELLATE_ABOVE_3(Each(4) Each(5))

namespace stellate::core {

// Returns call(std::integral_constant<int, k>()): makes k, which Validate() has let through, a
// constant. For all k `call` has to return the same type.
//
//   WithMeshDimension(spec.dimension, [](auto k) { return Doubler<k()>().Of(k()); });
template <typename Call>
auto WithMeshDimension(int k, const Call& call) {
  switch (k) {
#ifndef STELLATE_LOW_DIMENSIONS
    case 5:
      return call(std::integral_constant<int, 5>());
    case 4:
      return call(std::integral_constant<int, 4>());
#endif
    case 3:
      return call(std::integral_constant<int, 3>());
    case 2:
      return call(std::integral_constant<int, 2>());
    default:
      return call(std::integral_constant<int, 1>());
  }
}

}  // namespace stellate::core
