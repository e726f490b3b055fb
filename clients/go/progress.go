package stellate

import (
	"fmt"
	"os"
	"strings"
	"time"

	pb "stellate/proto/v1"
)

// ProgressBar is an OnProgress that keeps one live line on a terminal, and else prints few plain lines.
func ProgressBar(file *os.File) func(*pb.Progress) {
	about, err := file.Stat()
	live := err == nil && about.Mode()&os.ModeCharDevice != 0
	pause := 5 * time.Second
	if live {
		pause = 50 * time.Millisecond
	}
	var shown time.Time
	phase := pb.Phase_PHASE_UNSPECIFIED
	return func(p *pb.Progress) {
		if p.GetPhase() == phase && time.Since(shown) < pause {
			return
		}
		shown, phase = time.Now(), p.GetPhase()
		name := strings.ToLower(strings.TrimPrefix(phase.String(), "PHASE_"))
		line := fmt.Sprintf("%s %3.0f%%  %d vertices  %d simplices  %.1f s", name, 100*p.GetFraction(),
			p.GetVertices(), p.GetSimplices(), p.GetElapsedSeconds())
		switch {
		case !live:
			fmt.Fprintln(file, line)
		case phase == pb.Phase_PHASE_DONE:
			fmt.Fprintf(file, "\r%s\x1b[K\n", line)
		default:
			fmt.Fprintf(file, "\r%s\x1b[K", line)
		}
	}
}
