#include "outputs.h"

#include <CLI/CLI.hpp>

namespace stellate::cli {

CLI::Option* Outputs::AddTo(CLI::App* command) {
  return command->add_option(
      "-o,--output", paths_,
      "file to write, .txt .off .obj .ply .stl .3mf .glb .msh .vtu .npz .nas; may be given again. "
      "Large meshes go into it as they come, in little memory; held whole are those in .stl .3mf "
      ".glb .npz .nas and into pipes, the surfaces of solids in .off .ply, and a boundary alone in "
      ".obj .msh .vtu");
}

Expected<void> Outputs::Check(int dimension, int ambient_dimension) const {
  for (const std::string& path : paths_) {
    if (auto ok = CheckSave(path, dimension, ambient_dimension); !ok) return ok;
  }
  return {};
}

std::vector<Error> Outputs::Write(const Mesh& mesh) const {
  std::vector<Error> failures;
  for (const std::string& path : paths_) {
    if (const Expected<void> saved = mesh.Save(path); !saved) failures.push_back(saved.error());
  }
  return failures;
}

}  // namespace stellate::cli
