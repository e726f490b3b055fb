#include "view_command.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <thread>
#include <utility>

#include "demo.h"
#include "gateway.h"
#include "page.h"
#include "progress_bar.h"
#include "recording.h"
#include "stellate/mesh.h"

extern char** environ;

namespace stellate::cli {
namespace {

// The user's own choice of browser, or the desktop's. False: there is none to open.
bool OpenBrowser(const std::string& address) {
  const char* const chosen = std::getenv("BROWSER");
  const bool desktop =
      std::getenv("DISPLAY") != nullptr || std::getenv("WAYLAND_DISPLAY") != nullptr;
  const bool named = chosen != nullptr && *chosen != '\0';
  if (!named && !desktop) return false;
  const std::string program = named ? chosen : "xdg-open";
  posix_spawn_file_actions_t quiet;
  posix_spawn_file_actions_init(&quiet);
  posix_spawn_file_actions_addopen(&quiet, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&quiet, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&quiet, 2, "/dev/null", O_WRONLY, 0);
  const char* const arguments[] = {program.c_str(), address.c_str(), nullptr};
  pid_t child = 0;
  const int error = posix_spawnp(&child, program.c_str(), &quiet, nullptr,
                                 const_cast<char* const*>(arguments), environ);
  posix_spawn_file_actions_destroy(&quiet);
  if (error != 0) return false;
  std::thread([child] { waitpid(child, nullptr, 0); }).detach();
  return true;
}

}  // namespace

ViewCommand::ViewCommand(CLI::App& parent)
    : command_(parent.add_subcommand("view", "Show meshes in a browser, live")),
      server_(command_, "127.0.0.1:7717") {
  CLI::Option* const mesh = command_->add_option(
      "mesh", mesh_, "its whole name: meshes/ and 32 digits; default: the newest");
  CLI::Option* const html = command_->add_option(
      "--html", html_, "write the mesh and its report as one file that needs nothing, and exit");
  html->needs(mesh);
  CLI::Option* const demo =
      command_->add_flag("--demo", demo_, "watch a private server mesh the catalogue")
          ->excludes(html)
          ->excludes(mesh)
          ->excludes(command_->get_option("--server"));
  command_->add_flag("--page", template_, "print the page alone, for programs that fill it")
      ->excludes(html)
      ->excludes(mesh)
      ->excludes(demo);
  command_->add_option("--port", port_, "of 127.0.0.1 to serve the page at; 0: any that is free")
      ->capture_default_str();
  command_->add_flag("--no-browser", no_browser_, "print the page's address and open nothing");
  command_->footer(
      "The page is for this machine and this user alone. Ctrl-C ends it.\n"
      "Exit status: 0 done, 2 usage or refused, 3 no server.");
}

int ViewCommand::Run(std::stop_token stop) const {
  const Expected<std::string_view> page = view::Page();
  if (!page) return PrintError(page.error());
  if (template_) {
    std::cout << *page << std::flush;
    return std::cout ? kExitCertified : kExitRefused;
  }
  if (demo_) return ShowDemo(stop);
  return html_.empty() ? ShowLive(stop) : WriteHtml(std::move(stop));
}

int ViewCommand::WriteHtml(std::stop_token stop) const {
  const Expected<Connection> connection = server_.Read();
  if (!connection) return PrintError(connection.error());
  ProgressBar bar(false);
  view::RecordOptions options{*connection, {}, std::move(stop)};
  options.on_progress = [&bar](const Progress& progress) { bar.Show(progress); };
  const Expected<void> written = view::WriteRecording(mesh_, html_, options);
  bar.Clear();
  return written ? kExitCertified : PrintError(written.error());
}

Expected<void> ViewCommand::Serve(const Connection& connection, const std::stop_token& stop) const {
  view::GatewayOptions options;
  options.connection = connection;
  options.title = demo_ ? "the catalogue" : connection.server;
  options.mesh = mesh_;
  options.port = port_;
  options.demo = demo_;
  auto gateway = view::Gateway::Listen(std::move(options));
  if (!gateway) return tl::unexpected(gateway.error());
  const bool opened = !no_browser_ && OpenBrowser((*gateway)->AddressForOnce());
  std::printf("%s\n", (*gateway)->Address().c_str());
  std::fflush(stdout);
  std::fprintf(stderr, "stellate: %s; Ctrl-C ends it\n",
               opened ? "opened in the browser" : "open this address in a browser");
  (*gateway)->Run(stop);
  return {};
}

int ViewCommand::ShowLive(const std::stop_token& stop) const {
  if (!mesh_.empty() && !mesh_.starts_with("meshes/")) {
    std::cerr
        << "stellate: '" << mesh_
        << "' is not the name of a mesh on a server: such a name is meshes/ and 32 digits, and "
           "stellate top shows all of them. To look at a file, use ParaView or MeshLab, or "
           "stellate.load_txt(file).show() in Python\n";
    return kExitRefused;
  }
  const Expected<Connection> connection = server_.Read();
  if (!connection) return PrintError(connection.error());
  // A mistyped address shows here, not in the browser.
  const Expected<ServerHealth> health = CheckHealth(*connection);
  if (!health) return PrintError(health.error());
  const auto served = Serve(*connection, stop);
  return served ? kExitCertified : PrintError(served.error());
}

int ViewCommand::ShowDemo(const std::stop_token& stop) const {
  const auto demo = view::Demo::Start();
  if (!demo) return PrintError(demo.error());
  Expected<void> meshed;
  std::jthread meshing([&](const std::stop_token& own) {
    const std::stop_callback both(stop, [&meshing] { meshing.request_stop(); });
    meshed = (*demo)->Run(own, [](const std::string& manifold) {
      std::fprintf(stderr, "stellate: meshing %s\n", manifold.c_str());
    });
    if (!meshed) PrintError(meshed.error());
  });
  Connection own;
  own.server = (*demo)->server();
  const auto served = Serve(own, stop);
  meshing.request_stop();
  meshing.join();
  if (!served) return PrintError(served.error());
  return meshed ? kExitCertified : ExitStatusOf(meshed.error());
}

}  // namespace stellate::cli
