package stellate

import (
	"bufio"
	"os"
	"os/exec"
	"path/filepath"
	"runtime"
	"strings"
	"sync"
	"syscall"
	"time"
)

const stopSeconds = 10

// Server is a stellated of this process's own, which ends with it whatever happens.
type Server struct {
	// Address is where clients reach it, "unix:/path" or "host:port".
	Address string
	private bool
	command *exec.Cmd
	folder  string
	words   lastWords
	ended   chan struct{} // closed when the process is gone
}

// ServerOptions say how a server is started; all may be left out.
type ServerOptions struct {
	Binary string   // default: see FindStellated
	Listen string   // "host:port"; default: a unix socket that only this user may enter
	Flags  []string // more of stellated's, e.g. "--data-dir", "meshes"
}

// FindStellated gives the server binary: $STELLATED, else build/ of the source tree, else PATH.
func FindStellated() (string, error) {
	if named := os.Getenv("STELLATED"); named != "" {
		path, err := exec.LookPath(named)
		if err != nil {
			return "", newError(ErrServerNotFound, "SERVER_NOT_FOUND", "$STELLATED is %s: %v", named, err)
		}
		return path, nil
	}
	_, source, _, _ := runtime.Caller(0)
	build := filepath.Join(filepath.Dir(source), "..", "..", "build")
	others, _ := filepath.Glob(filepath.Join(build, "*", "bin", "stellated"))
	for _, path := range append([]string{filepath.Join(build, "release", "bin", "stellated")}, others...) {
		if path, err := exec.LookPath(path); err == nil {
			return path, nil
		}
	}
	if path, err := exec.LookPath("stellated"); err == nil {
		return path, nil
	}
	return "", newError(ErrServerNotFound, "SERVER_NOT_FOUND",
		"no server was given and no stellated found to start: give Options.Server, or set $STELLATED to the "+
			"binary, or put it on PATH, or build it (clients/quickstart does)")
}

// StartServer starts a server, and returns when it listens.
func StartServer(options ServerOptions) (*Server, error) {
	binary := options.Binary
	if binary == "" {
		found, err := FindStellated()
		if err != nil {
			return nil, err
		}
		binary = found
	}
	flags := []string{"--drain-seconds", "0"}
	if options.Listen == "" {
		// One that answers no pings is merely busy in an oracle.
		flags = append(flags, "--keepalive", "600", "--keepalive-timeout", "600")
	}
	return launch(binary, append(flags, options.Flags...), options.Listen)
}

func launch(binary string, flags []string, listen string) (*Server, error) {
	folder, err := os.MkdirTemp("", "stellate-")
	if err != nil {
		return nil, err
	}
	address := listen
	if address == "" {
		address = "unix:" + filepath.Join(folder, "socket")
	}
	words := append([]string{"--exit-with-parent", "--listen", address}, flags...)
	s := &Server{private: listen == "", folder: folder, ended: make(chan struct{})}
	s.command = exec.Command(binary, words...)
	s.command.Stderr = &s.words
	// A session of its own: Ctrl-C is for the client, which cancels its meshes first.
	s.command.SysProcAttr = &syscall.SysProcAttr{Setsid: true}
	out, err := s.command.StdoutPipe()
	if err == nil {
		err = s.command.Start()
	}
	if err != nil {
		os.RemoveAll(folder)
		return nil, newError(ErrServerNotFound, "SERVER_NOT_FOUND", "cannot start %s: %v", binary, err)
	}
	for lines := bufio.NewScanner(out); s.Address == "" && lines.Scan(); {
		_, s.Address, _ = strings.Cut(lines.Text(), " listening on ")
	}
	go func() {
		_ = s.command.Wait()
		close(s.ended)
	}()
	if s.Address == "" {
		<-s.ended
		os.RemoveAll(folder)
		return nil, s.whyGone()
	}
	return s, nil
}

// whyGone is an error with the last words of a server that is no more, or nil for one that runs.
func (s *Server) whyGone() error {
	select {
	case <-s.ended:
		return newError(ErrUnavailable, "SERVER_GONE", "stellated ended (%v): %s", s.command.ProcessState, s.words.String())
	default:
		return nil
	}
}

// Close stops the server and removes its directory. It may be called again.
func (s *Server) Close() error {
	_ = s.command.Process.Signal(syscall.SIGTERM) // it may have ended
	select {
	case <-s.ended:
	case <-time.After(stopSeconds * time.Second):
		_ = s.command.Process.Kill()
		<-s.ended
	}
	return os.RemoveAll(s.folder)
}

// lastWords keeps the end of what is written.
type lastWords struct {
	mutex sync.Mutex
	text  []byte
}

func (w *lastWords) Write(said []byte) (int, error) {
	w.mutex.Lock()
	defer w.mutex.Unlock()
	w.text = append(w.text, said...)
	w.text = w.text[max(0, len(w.text)-2000):]
	return len(said), nil
}

func (w *lastWords) String() string {
	w.mutex.Lock()
	defer w.mutex.Unlock()
	return strings.TrimSpace(string(w.text))
}
