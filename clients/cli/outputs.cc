#include "outputs.h"

#include <CLI/CLI.hpp>

#include "server_options.h"

namespace stellate::cli {

CLI::Option* Outputs::AddTo(CLI::App* command) {
  return command->add_option(
      "-o,--output", paths_,
      "file to write, .txt .off .obj .ply .stl .msh .vtu; may be given again. Large meshes go "
      "into it as they come, in little memory; held whole are those in .stl and into pipes, of "
      "manifolds with boundary in .obj .msh .vtu, and the surfaces of solids");
}

Expected<void> Outputs::Check(int dimension, int ambient_dimension) const {
  for (const std::string& path : paths_) {
    if (auto ok = CheckSave(path, dimension, ambient_dimension); !ok) return ok;
  }
  return {};
}

int Outputs::Write(const Mesh& mesh, int status) const {
  for (const std::string& path : paths_) {
    if (const Expected<void> saved = mesh.Save(path); !saved) status = PrintError(saved.error());
  }
  return status;
}

}  // namespace stellate::cli
