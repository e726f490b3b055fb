package stellate_test

import (
	"context"
	"errors"
	"strings"
	"testing"

	"stellate"
	pb "stellate/proto/v1"
)

func finding(report *pb.CheckReport, code string) *pb.Finding {
	for _, one := range report.GetFindings() {
		if one.GetCode() == code {
			return one
		}
	}
	return nil
}

func TestDoctorPassesATorus(t *testing.T) {
	ctx := context.Background()
	report, err := stellate.Check(ctx, torus, 0.3)
	if err != nil {
		t.Fatal(err)
	}
	if !report.GetOk() || report.GetPieces() != 1 || !strings.Contains(report.GetText(), "keeps its contract") {
		t.Error(report.GetText())
	}
	if reach := report.GetReach(); reach < 0.39 || reach > 0.41 {
		t.Error("reach", reach)
	}
	if finding(report, "COARSE_EPSILON").GetSeverity() != pb.Severity_SEVERITY_WARNING {
		t.Error(report.GetText())
	}
	epsilon, reason, err := stellate.ChooseEpsilon(ctx, torus)
	if epsilon != 0.1 || !strings.HasPrefix(reason, "a quarter of the reach, about 0.4") || err != nil {
		t.Error(epsilon, reason, err)
	}
}

func TestDoctorNamesWhatIsWrong(t *testing.T) {
	ctx := context.Background()
	moving := spoilt{torus, new(int), func(points []float64) error {
		for i := range points {
			points[i] *= 1.01
		}
		return nil
	}}
	report, err := stellate.Check(ctx, moving, 0)
	if err != nil {
		t.Fatal(err)
	}
	found := finding(report, "NOT_IDEMPOTENT")
	if report.GetOk() || found.GetSeverity() != pb.Severity_SEVERITY_ERROR ||
		!strings.Contains(found.GetAdvice(), "Answer with points of M") {
		t.Error(report.GetText())
	}
	var ours *stellate.Error
	_, _, err = stellate.ChooseEpsilon(ctx, moving)
	if !errors.As(err, &ours) || !errors.Is(err, stellate.ErrOracle) || ours.Reason != "ORACLE_BREAKS_CONTRACT" {
		t.Error(err)
	}
	report, err = stellate.Check(ctx, spoilt{torus, new(int), func([]float64) error { return errors.New("no such surface") }}, 0)
	if err != nil || !strings.Contains(finding(report, "RAISED").GetMessage(), "no such surface") {
		t.Error(report.GetText(), err)
	}
}
